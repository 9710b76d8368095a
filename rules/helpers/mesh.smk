# Functions for the rule of mesh.smk.


def mesh_settings(dataset):
    """Return the settings of a dataset's meshes. Ends the run for a dataset without any."""
    if not dataset.mesh:
        sys.exit(
            f"error: {dataset.paths.folder}/{MESH}: the scene YAML asks for no mesh of it"
        )
    passes = dataset.render.passes or ()
    settings = MeshSettings.of(
        formats=dataset.mesh.formats,
        frame=dataset.source.frame,
        scene_name=dataset.source.scene_name,
        view_layers=dataset.source.view_layers,
        numbered=not {"object", "instance"}.isdisjoint(passes),
    )
    return settings.as_json()
