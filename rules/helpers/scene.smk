# Functions for the rules of scene.smk.


def build_settings(dataset):
    """Return the settings of a built scene. Ends the run for a scene without a builder."""
    if dataset.source.builder is None:
        sys.exit(
            f"error: {dataset.paths.scene_work}/scene.blend: the scene YAML has no builder that makes it"
        )
    settings = BuildSettings(
        builder=dataset.source.builder,
        parameters=dataset.source.parameters,
        fingerprint=dataset.fingerprint,
    )
    return settings.as_json()


def import_settings(dataset):
    """Return the settings of a model's import. Ends the run for a scene without a model."""
    source = load_scene(dataset.scene_name).scene
    if source.model is None:
        sys.exit(
            f"error: {dataset.paths.scene_work}/model.blend: the scene YAML has no model that makes it"
        )
    return ImportSettings.of_source(source).as_json()


def inventory_settings(dataset):
    """Return the settings of a scene's inventory: what it depends on in the scene YAML."""
    written = load_scene(dataset.scene_name)
    datasets = scene_datasets(dataset.scene_name)
    settings = {
        # Raise this number when the program lists something else.
        "version": 5,
        "scene_name": written.scene.scene_name,
        "view_layers": written.scene.view_layers,
        "allow_missing": written.scene.allow_missing,
        "motion_blur": written.render.motion_blur,
        "rendered_frames": rendered_frames(datasets),
        # Like the program, leave out rigs without frames.
        "camera_frames": [frame for each in datasets for frame in each.camera_frames],
    }
    if settings["camera_frames"]:
        # Raise this number when the program takes or refuses other cameras.
        settings["camera_version"] = 1
    if written.scene.followed_camera:
        settings["followed_camera"] = written.scene.followed_camera
    if written.render.light_groups:
        settings["light_groups"] = written.render.light_groups
    return settings


def blend_of(wildcards):
    """Return a scene's .blend. A user's own file is on the machine that runs Snakemake."""
    dataset = scene_of(wildcards)
    return local(dataset.blend) if dataset.source.blend else dataset.blend or []
