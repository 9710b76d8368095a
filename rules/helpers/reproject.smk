# What the rules of reproject.smk ask of the configuration.


def lens_maps_of(wildcards):
    """Return the lens maps of a reprojection; none of what is not one."""
    dataset, name = dataset_of(wildcards), wildcards.reprojection
    return dataset.lens_maps(name) if name in dataset.reprojections else []


def reprojection_settings_of(stage, content):
    """Return the input function for a reprojection's settings file: ``content`` of its settings."""

    def input_function(wildcards):
        dataset, name = dataset_of(wildcards), wildcards.reprojection
        settings = content(reprojection_of(wildcards).settings)
        return dataset_settings(dataset, f"{name}/{stage}", settings)

    return input_function
