# What the rules of validate.smk ask of the configuration.


def reprojection_words(wildcards):
    """Return the words that name a dataset's reprojections."""
    words = [f"--reprojection {name}" for name in dataset_of(wildcards).reprojections]
    return " ".join(words)
