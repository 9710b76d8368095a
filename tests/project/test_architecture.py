"""The packages are those of docs/explanation/architecture.md, and import only those above them."""

import ast
import io
import itertools
import re
import subprocess
import sys
import tokenize
from collections import defaultdict
from pathlib import Path

import pytest

from lightfield.workflow import jobs

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "scripts" / "lightfield"
PAGE = ROOT / "docs/explanation/architecture.md"
PACKAGES = re.findall(r"^\| (\w+) \|", PAGE.read_text().split("## Where to look")[0], re.M)[1:]


def imported(file):
    """Return the dotted names of all that a file imports, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, file
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def test_each_package_says_what_it_holds():
    assert {path.parent.name for path in LIBRARY.glob("*/__init__.py")} == set(PACKAGES)
    for package in PACKAGES:
        assert ast.get_docstring(ast.parse((LIBRARY / package / "__init__.py").read_text())), (
            package
        )


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_only_those_above_it(package):
    allowed = PACKAGES[: PACKAGES.index(package) + 1]
    for file in (LIBRARY / package).rglob("*.py"):
        imported_packages = {
            name.split(".")[1] for name in imported(file) if name.startswith("lightfield.")
        }
        assert imported_packages <= set(allowed), file
        blenders = {"bpy", "mathutils", "bmesh"} & {name.split(".")[0] for name in imported(file)}
        assert not blenders or package == "rendering", file


# The rooms of rendering, in the order in which they may import each other.
ROOMS = ["models", "scenes", "setup", "inspection", "imports", "views"]


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_of_rendering_imports_only_those_before_it(room):
    rendering = LIBRARY / "rendering"
    assert {path.parent.name for path in rendering.glob("*/__init__.py")} == set(ROOMS)
    allowed = {"__init__", *ROOMS[: ROOMS.index(room) + 1]}
    for file in (rendering / room).rglob("*.py"):
        prefix = "lightfield.rendering."
        rooms = {name.split(".")[2] for name in imported(file) if name.startswith(prefix)}
        assert rooms <= allowed, file


def test_no_files_import_each_other_in_a_circle():
    arrows = {}
    for path in LIBRARY.rglob("*.py"):
        name = ".".join(("lightfield", *path.relative_to(LIBRARY).with_suffix("").parts))
        imported_names = imported(path)
        # An imported name may be a file, or a name in a file.
        arrows[name.removesuffix(".__init__")] = imported_names | {
            n.rpartition(".")[0] for n in imported_names
        }
    arrows = {name: others & arrows.keys() - {name} for name, others in arrows.items()}
    while free := [name for name, others in arrows.items() if not others & arrows.keys()]:
        for name in free:
            del arrows[name]
    assert not arrows


def without_encoding(file):
    """Yield the calls of a file whose text has the encoding of the user's locale."""
    for call in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(call, ast.Call) and isinstance(call.func, (ast.Attribute, ast.Name)):
            name = ast.unparse(call.func).rpartition(".")[2]
            keywords = {keyword.arg for keyword in call.keywords}
            texts = [n.value for n in ast.walk(call) if isinstance(n, ast.Constant)]
            is_text = {
                "read_text": not call.args,
                "write_text": len(call.args) == 1,
                "open": any(re.fullmatch(r"[rwax]\+?", str(text)) for text in texts),
            }.get(name, "text" in keywords)
            is_other = ast.unparse(call.func) in OTHER_CALLS
            if is_text and not is_other and "encoding" not in keywords:
                yield f"{file}:{call.lineno}: {ast.unparse(call)}"


# Functions with the names of those that read and write text.
OTHER_CALLS = ("model(source, self.points).write_text", "tarfile.open", "write_text")


def test_code_names_the_encoding_of_each_text():
    folders = ("scripts", "benchmarks", "docs", "envs")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert [*itertools.chain(*map(without_encoding, files))] == []
    for path in (ROOT / "rules").glob("*.smk"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\.(read|write)_text\((?!encoding)|text=True", text), path


def modules_after(program):
    """Return the names of the modules that a Python program imports."""
    program += "\nimport sys\nprint(*sys.modules)"
    return subprocess.run(
        [sys.executable, "-c", program], cwd=LIBRARY.parent, capture_output=True, text=True
    ).stdout.split()


def test_reading_the_rules_imports_nothing_heavy():
    lines = "\n".join(file.read_text() for file in (ROOT / "rules").rglob("*.smk"))
    imports = re.findall(r"^from lightfield\S* import (?:\([^)]*\)|.*)", lines, re.M)
    modules = modules_after("\n".join(imports))
    assert "lightfield.planning.loading" in modules
    assert not {"numba", "skimage", "scipy", "OpenImageIO", "matplotlib", "bpy"} & set(modules)


def test_placing_the_cameras_of_a_built_scene_imports_no_models_of_other_keys():
    modules = modules_after("import lightfield.stages.rig")
    assert "lightfield.geometry.rigs" in modules
    assert not {"lightfield.configuration.scene_yaml", "lightfield.exporters"} & set(modules)


# The modules by which the workflow knows what is finished, outdated or damaged.
MECHANISMS = [
    "lightfield.engine.receipts",
    "lightfield.workflow.check",
    "lightfield.workflow.history",
    "lightfield.workflow.member_record",
    "lightfield.workflow.presence",
    "lightfield.planning.shard_counts",
    "lightfield.workflow.shard_log",
    "lightfield.validation.verification",
]
# The names of their files.
NOTES = re.compile(r"work/receipts|\.part\b|\bcheck\.txt|\bsums\.json|\.sums\.jsonl")


def test_promises_are_tested_without_the_mechanisms_that_keep_them():
    """These tests and their helpers ask tests/bookkeeping.py. So it alone changes with these."""
    paths = [
        *ROOT.glob("tests/*.py"),
        *ROOT.glob("tests/blender/*.py"),
        *ROOT.glob("benchmarks/*.py"),
    ]
    helpers = {path.stem: path for path in paths if path.stem != "bookkeeping"}
    files = [*ROOT.glob("tests/promises/*.py")]
    assert files
    # The list grows while it is read.
    for file in files:
        names = imported(file)
        assert not [name for name in names if name.startswith(tuple(MECHANISMS))], file
        assert not NOTES.search(file.read_text()), file
        modules = {name.split(".")[0] for name in names}
        files += [helpers[name] for name in helpers.keys() & modules if helpers[name] not in files]


# How Python and NumPy open a file, but for writing.
OPENS = re.compile(r"\.(?:read_bytes|read_text)\(|(?<!tarfile)\.open\((?!\"[wax])|\bnp\.load\(")
READERS = (
    *("reading", "export", "exporters", "products", "reprojection", "validation", "synthesis"),
    *("measurement", "report", "publishing"),
)
# Templates of the package, a file whose bytes are compared right before, and the file that reads
# published datasets without Plenoforge.
MAY_OPEN = {
    *(LIBRARY / "report/page.py", LIBRARY / "reprojection/lens_map.py"),
    LIBRARY / "publishing/read.py",
}


def test_no_reader_of_datasets_passes_by_the_comparison_with_receipts():
    """`core.files.open_file`, and all that calls it, compares what a job reads."""
    files = [file for room in READERS for file in (LIBRARY / room).rglob("*.py")]
    assert not [file for file in {*files} - MAY_OPEN if OPENS.search(file.read_text())]


# A figure that is divided by a unit, or that has digits and a unit behind them.
UNITS = re.compile(
    r"\{[^{}\n]*/ ?(?:1e[369]|3600|60|1024)[^{}\n]*:[^{}\n]*\}"
    r"|:[,.]*\d[fg]\} (?:s|min|h|hours|kWh|kB|MB|GB|TB)\b"
)
# The second writes lines that the terminal's display reads.
WRITES_UNITS = {LIBRARY / "core/units.py", LIBRARY / "core/progress.py"}


def test_one_module_writes_times_and_sizes():
    files = [*(ROOT / "scripts").rglob("*.py"), *(ROOT / "rules").rglob("*.smk")]
    assert {file for file in files if UNITS.search(file.read_text())} == WRITES_UNITS


# The records of jobs, by their names in the rules.
RECORDS = {name: [record] for name, record in vars(jobs).items() if isinstance(record, jobs.Job)}
# A rule in a loop has several.
RECORDS["EXPORTED"] = [*jobs.EXPORT_RULES.values()]


def rules_of_records():
    """Yield the text of each rule whose job has a record, and the record."""
    text = "\n".join(file.read_text() for file in (ROOT / "rules").glob("*.smk"))
    for rule in re.split(r"^(?=rule |use rule |for )", text, flags=re.M):
        if named := re.search(r"PLAN\.receipt_of\((\w+)\)", rule):
            yield from ((rule, record) for record in RECORDS[named[1]])


def test_each_record_of_a_job_has_a_rule():
    assert {record.name for _, record in rules_of_records()} == {job.name for job in jobs.JOBS}


def test_a_rule_names_one_record_in_all_its_directives():
    for rule, record in rules_of_records():
        named = re.findall(r"(?:reads|receipt_of|bundle_of|log_of|times_of)\(\s*(\w+)", rule)
        assert len({*named}) == 1 and record in RECORDS[named[0]], rule
        declares_bundle = "PLAN.bundle_of" in rule
        assert declares_bundle == record.has_bundle, record.name


def test_the_command_of_a_rule_runs_the_stage_of_its_record():
    programs = defaultdict(set)
    for rule, record in rules_of_records():
        programs[record] |= set(re.findall(r"RUN\.scripts}/(\w+)\.py", rule))
    # Two rules make views.
    programs[jobs.RENDER].remove("import_views")
    # These rules use the command of another one.
    using = {jobs.PROBE_CAMERAS, jobs.PANORAMA_LIGHTFIELD, jobs.EXPORT_SEQUENCE}
    for record in jobs.JOBS:
        assert programs[record] == ({record.stage.name} if record not in using else set())


def test_the_jobs_that_run_beside_snakemake_are_known():
    local_jobs = {
        record.name
        for rule, record in rules_of_records()
        if re.search(r"^    localrule: True$", rule, re.M)
    }
    assert local_jobs == {job.name for job in jobs.JOBS if job.is_local}


def test_the_files_of_rules_define_no_functions():
    """The Python of a run is in scripts/lightfield/workflow, where mypy and imports find it."""
    for file in (ROOT / "Snakefile", *(ROOT / "rules").glob("*.smk")):
        assert not re.search(r"^\s*(?:def|class|try|with|@)\b", file.read_text(), re.M), file


# What the Snakefile and rules/common.smk make for all rules.
SHARED = {"CONFIG", "FOLDER", "HANDLERS", "IS_MAIN_PROCESS", "PLAN", "REQUESTS", "RUN"}


def test_the_files_of_rules_share_only_the_run():
    for file in (ROOT / "rules").glob("*.smk"):
        text = file.read_text()
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        constants = {
            token.string
            for before, token in itertools.pairwise(tokens)
            if token.type == tokenize.NAME and token.string.isupper() and before.string != "."
        }
        own = set(re.findall(r"^(\w+) = ", text, re.M))
        own |= {
            name for loop in re.findall(r"^for (.*) in ", text, re.M) for name in loop.split(", ")
        }
        imports = re.findall(r"^from \S+ import (\([^)]*\)|.*)", text, re.M)
        own |= {name for names in imports for name in re.findall(r"\w+", names)}
        assert constants <= own | SHARED, file


# Snakemake's documentation allows a Snakefile these.
PUBLIC = r"workflow\.(?:cores|current_basedir)\b|workflow\.rst"
MODULES = r"\b(?:from|import) snakemake\b(?!\.utils import min_version)"
INSIDE = re.compile(
    rf"(?!{PUBLIC})(?<!lightfield\.)\bworkflow\.\w+|__signature__|{MODULES}|\bhosted_repo\b|\brepo_path\b"
    r"|getLogger|addHandler|addFilter"
)
# Nothing public names the repository from which Snakemake has read a module.
MAY_REACH_INSIDE = {ROOT / "workflow/Snakefile"}


def test_only_the_module_for_the_catalog_reaches_inside_snakemake():
    files = [*ROOT.glob("Snakefile"), *ROOT.glob("workflow/*"), *(ROOT / "rules").rglob("*.smk")]
    reaching = {file for file in files if INSIDE.search(file.read_text())}
    assert reaching == MAY_REACH_INSIDE
