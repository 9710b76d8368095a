# What the rules of scene.smk ask of the configuration.


def build_settings(dataset):
    """Return the settings of a built scene; ends the run for a scene without a builder."""
    if dataset.source.builder is None:
        sys.exit(
            f"error: {dataset.scene_work}/scene.blend: the scene YAML has no builder that makes it"
        )
    settings = BuildSettings(
        builder=dataset.source.builder,
        parameters=dataset.source.parameters,
        fingerprint=dataset.fingerprint,
    )
    return settings.as_json()


def inventory_settings(dataset):
    """Return what a scene's inventory depends on of its scene YAML."""
    written = load_scene(dataset.scene_name)
    datasets = scene_datasets(dataset.scene_name)
    return {
        # Raised when the program lists something else.
        "version": 4,
        "scene_name": written.scene.scene_name,
        "view_layers": written.scene.view_layers,
        "allow_missing": written.scene.allow_missing,
        "motion_blur": written.render.motion_blur,
        "rendered_frames": rendered_frames(datasets),
        # As the program has them: a rig without any changes nothing.
        "camera_frames": [frame for each in datasets for frame in each.camera_frames],
    }


def blend_of(wildcards):
    """Return a scene's .blend, which a user has where Snakemake runs."""
    dataset = scene_of(wildcards)
    return local(dataset.blend) if dataset.source.blend else dataset.blend
