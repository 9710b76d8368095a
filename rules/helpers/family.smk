# Functions for the rules of family.smk.
from lightfield.configuration import keys
from lightfield.configuration.corpus import CORPUS_FILES
from lightfield.configuration.family import RECORD, outdated_members
from lightfield.stages.family import BatchSettings, CorpusSettings, CountSettings
from lightfield.core.names import SOFTBOXES

# The names of the chosen families, by their folders.
FAMILY_FOLDERS = {family_folder(name, SETTINGS): name for name in FAMILIES}


wildcard_constraints:
    family="|".join(FAMILY_FOLDERS) or "(?!)",
    batch=r"(seeds|models)_\d+_(of_)?\d+",


@cache
def batches_of(folder):
    """Return the members of each batch of a family. Ends the run if there are none."""
    name = FAMILY_FOLDERS[folder]
    try:
        return FAMILIES[name].batches()
    except UserError as error:
        sys.exit(f"error: {scene_path(name)}: {error}")


def source_fingerprint(source, values):
    """Return what changes with a builder's text, or with the import of models."""
    if source.builder:
        return keys.scene_fingerprint(source)
    # A drawn light may be the softboxes.
    import_version = keys.import_version(
        SOFTBOXES if "scene.light" in values else source.light
    )
    # Batches of the first version keep their settings.
    return str(import_version) if import_version > 1 else None


@cache
def common_settings(folder):
    """Return the settings that all batches of a family have."""
    name = FAMILY_FOLDERS[folder]
    content = scene_content(name)
    # New members must not change the settings of the others.
    del content["family"]
    source = load_scene(name).scene
    return {
        "family": name,
        "scene": content,
        "values": FAMILIES[name].values,
        "preset": SETTINGS.preset,
        "limits": SETTINGS.presets[SETTINGS.preset],
        "results": RESULTS,
        "work": WORK,
        "fingerprint": source_fingerprint(source, FAMILIES[name].values),
        "bpy": version("bpy"),
    }


def batch_settings(wildcards):
    """Return the settings file of a batch, and mark the batch if its members are outdated."""
    folder = wildcards.family
    members = one_of(batches_of(folder), wildcards.batch, WORK, "batch of it")
    settings = BatchSettings.of(members=members, **common_settings(folder))
    if IS_MAIN_PROCESS:
        mark_noted_files()
        # With a storage, the members are not here.
        record = batch_record(folder, wildcards.batch)
        if not STORE and outdated_members(Path(record), Path(RESULTS, folder)):
            rerun([record])
    path = f"{WORK}/{folder}/settings/batches/{wildcards.batch}.json"
    return settings_file(path, settings.as_json())


def batch_record(folder, batch):
    """Return the record of a batch."""
    return f"{WORK}/{folder}/batches/{batch}.json"


def records_of(folder):
    """Return the records of all batches of a family."""
    return [batch_record(folder, batch) for batch in batches_of(folder)]


def batch_records(wildcards):
    """Return the records of all batches of a family."""
    return records_of(wildcards.family)


def count_settings(wildcards):
    """Return the settings file of the count of a family's members."""
    settings = CountSettings(
        family=FAMILY_FOLDERS[wildcards.family], records=batch_records(wildcards)
    )
    return settings_file(
        f"{WORK}/{wildcards.family}/settings/members.json", settings.as_json()
    )


def corpus_settings(wildcards):
    """Return the settings file of a family's corpus. It names all members."""
    folder = wildcards.family
    options = FAMILIES[FAMILY_FOLDERS[folder]].corpus
    members = [member.name for batch in batches_of(folder).values() for member in batch]
    settings = CorpusSettings(**dict(options), family=folder, members=sorted(members))
    return settings_file(f"{WORK}/{folder}/settings/corpus.json", settings.as_json())


def batch_threads(wildcards):
    """Return the cores of each batch: one, or more if there are fewer batches than cores."""
    count = sum(len(batches_of(folder)) for folder in FAMILY_FOLDERS)
    return max(1, (workflow.cores or 1) // count)


@cache
def member_datasets(folder):
    """Return the datasets of a member that stands for all members of a family."""
    limits = SETTINGS.presets[SETTINGS.preset]
    return scene_datasets(FAMILY_FOLDERS[folder], SETTINGS.preset, limits, SETTINGS)


def missing_members(wildcards):
    """Return how many members of a batch have no record yet."""
    folder = wildcards.family
    names = [member.name for member in batches_of(folder)[wildcards.batch]]
    return sum(
        not os.path.exists(f"{RESULTS}/{folder}/{name}/{RECORD}") for name in names
    )


def batch_views(wildcards):
    """Return how many views the missing members of a batch have."""
    datasets = member_datasets(wildcards.family)
    return missing_members(wildcards) * sum(d.view_count for d in datasets)


def batch_cost(wildcards):
    """Return the cost of the missing members of a batch."""
    return members_cost(member_datasets(wildcards.family), missing_members(wildcards))


def family_results():
    """Return the folders of the chosen families that have members."""
    folders = [f"{RESULTS}/{folder}" for folder in FAMILY_FOLDERS]
    return [folder for folder in folders if any(Path(folder).glob(f"*/{RECORD}"))]


def family_targets():
    """Return the files that a run with families makes."""
    files = corpora()
    for folder in FAMILY_FOLDERS:
        files += [f"{WORK}/{folder}/members.json", *records_of(folder)]
    return files


def corpora():
    """Return the files of the chosen families' corpora."""
    return [
        f"{RESULTS}/{folder}/{name}"
        for folder in FAMILY_FOLDERS
        for name in CORPUS_FILES
    ]
