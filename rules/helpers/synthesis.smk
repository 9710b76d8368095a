# Functions for the rules of synthesis.smk.


def reach(dataset):
    """Return the largest distance of a rig's cameras from their middle, in metres."""
    places = [pose.position for pose in dataset.rig.poses()]
    middle = [sum(axis) / len(places) for axis in zip(*places)]
    return max(math.dist(place, middle) for place in places)


def held_out(dataset):
    """Return the scene's chosen datasets that reach less far than this one.

    Empty for a rig whose cameras span no surface, because nothing lies between them.
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
    """Return the settings of a measurement: the datasets to compare synthesised views with."""
    truths = held_out(dataset)
    return SynthesisSettings(truth=[truth.paths.folder for truth in truths]).as_json()


def truth_records(wildcards):
    """Return the records of those datasets' views."""
    truths = held_out(dataset_of(wildcards))
    return [record for truth in truths for record in truth.records("render")]
