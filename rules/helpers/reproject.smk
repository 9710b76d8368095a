# Functions for the rules of reproject.smk.


def lens_maps_of(wildcards):
    """Return the lens maps of a reprojection. Empty if there is no such reprojection."""
    dataset = dataset_of(wildcards)
    name = wildcards.reprojection
    return dataset.lens_maps(name) if name in dataset.reprojections else []


def reprojection_settings_of(stage, content):
    """Return the input function for a reprojection's settings file.

    ``content`` is a function that returns the file's content from the reprojection.
    """

    def input_function(wildcards):
        settings = content(reprojection_of(wildcards))
        name = f"{wildcards.reprojection}/{stage}"
        return dataset_settings(dataset_of(wildcards), name, settings)

    return input_function
