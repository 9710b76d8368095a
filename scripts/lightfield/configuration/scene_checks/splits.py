"""Checks the rigs of a split: trainers see them as one dataset."""

from collections.abc import Set

from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.core.names import PARTS


def check(blocks: SceneBlocks) -> None:
    """Check that a split has both parts, equal cameras, and blocks that choose all of it."""
    split_rigs = {name: rig for name, rig in blocks.rigs.items() if rig.split in PARTS}
    if not split_rigs:
        return
    training = next((name for name, rig in split_rigs.items() if rig.split == "train"), None)
    if training is None:
        name = next(iter(split_rigs))
        raise _lacks_part(name, str(split_rigs[name].split), "train")
    if not any(rig.split == "test" for rig in split_rigs.values()):
        raise _lacks_part(training, "train", "test")
    for name, rig in split_rigs.items():
        for key in ("camera", "frames"):
            if getattr(rig, key) != getattr(split_rigs[training], key):
                raise ValueError(f"rigs.{name}.{key}: must be as in {training}, which trains")
    for name, reprojection in blocks.developments.items():
        key = f"reprojections.{name}" if name in blocks.reprojections else "sensor"
        _check_whole_split(blocks, f"{key}.rigs", split_rigs.keys(), reprojection.rigs)
    for name, export in blocks.exports.selected.items():
        if export.joins_split:
            key = f"exports.{name}.{export.rigs_key}"
            _check_whole_split(blocks, key, split_rigs.keys(), export.chosen_rigs)


def _lacks_part(rig_name: str, part: str, missing_part: str) -> ValueError:
    """Return the error that no rig has the part that belongs to the part of a rig."""
    return ValueError(
        f"rigs.{rig_name}.split: is {part}, but no rig has split: {missing_part}; give it to one. "
        f"Or give {rig_name} {{every: 8}}, which splits only its own rig"
    )


def _check_whole_split(
    blocks: SceneBlocks, key: str, split_rigs: Set[str], chosen_rigs: list[str] | None
) -> None:
    """Check that the chosen rigs, or all without a choice, have a whole split or none of it."""
    missing_rigs = split_rigs - set(chosen_rigs or blocks.rigs)
    if missing_rigs and missing_rigs != split_rigs:
        rigs = ", ".join(sorted(missing_rigs))
        raise ValueError(
            f"{key}: lacks {rigs}; must have all rigs of the split, the one that trains and "
            "the ones that test, or none"
        )
