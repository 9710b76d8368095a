"""Downloads a scene's .blend, and checks that it is the recorded one."""

from importlib.metadata import version

from lightfield.configuration import blend_lock
from lightfield.configuration.scene_yaml import load_scene, mistake, scene_path
from lightfield.core import download
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.engine import receipts
from lightfield.engine.read_files import changed_since_plan
from lightfield.stages.scene import CheckBlend, FetchBlend


def fetch(job: FetchBlend) -> None:
    """Download the .blend. Continue where an earlier download was interrupted."""
    source = load_scene(job.scene).scene
    if source.url is None:
        raise mistake(job.scene, "scene: is missing the key url")
    expected, origin = blend_lock.blend_sha256(job.scene, source)
    download.fetch(source.url, job.output, expected, str(origin))


def check(job: CheckBlend) -> None:
    """Check the .blend's SHA-256, and record it on first use. Write what is known of the file."""
    source = load_scene(job.scene).scene
    if source.blend is None:
        raise UserError(f"--scene {job.scene}: does not use a .blend")
    # By hand, there was no plan.
    if job.receipt and source.sha256 != job.settings.sha256:
        raise changed_since_plan(scene_path(job.scene))
    status = job.blend.stat()
    digest = sha256(job.blend)
    if lock := blend_lock.expected_blend(job.scene, source, job.blend, digest):
        blend_lock.record_blend(job.blend, digest, lock)
    if not source.sha256:
        # Without its lock file, the .blend is checked again.
        _, lock = blend_lock.blend_sha256(job.scene, source)
        receipts.note_inputs([lock])
    content = {
        "sha256": digest,
        "bytes": status.st_size,
        "mtime_ns": status.st_mtime_ns,
        "bpy": version("bpy"),
    }
    write_json(job.output, content)
