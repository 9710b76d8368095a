# What the rules of synthesis.smk ask of the configuration.


def reach(dataset):
    """Return how far a rig's cameras are from their middle, in metres."""
    places = [pose.position for pose in dataset.rig.poses()]
    middle = [sum(axis) / len(places) for axis in zip(*places)]
    return max(math.dist(place, middle) for place in places)


def held_out(dataset):
    """Return the scene's chosen datasets whose cameras are all nearer together than a light field's.

    A rig whose cameras span no surface has nothing between them.
    """
    if dataset.rig.cells() is None:
        return []
    return [
        other
        for other in CHOSEN
        if other.scene_folder == dataset.scene_folder
        and other.rig.cells() is not None
        and reach(other) < reach(dataset)
    ]


def synthesis_settings(dataset):
    """Return the settings of a measurement: with which datasets synthesised views are compared."""
    truths = held_out(dataset)
    return SynthesisSettings(truth=[truth.folder for truth in truths]).as_json()


def truth_records(wildcards):
    """Return the records of those datasets' views."""
    truths = held_out(dataset_of(wildcards))
    return [record for truth in truths for record in truth.records("render")]
