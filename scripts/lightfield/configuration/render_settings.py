"""The block `render` of a scene YAML: samples, passes, light groups, motion and denoising."""

import re
from typing import Self

from pydantic import model_validator

from lightfield.formats import light_groups
from lightfield.formats.passes import VARIANCE
from lightfield.formats.render_block import RenderOptions, TargetError

# The keys of `Render` that a calibration chooses for a target error.
CALIBRATED_KEYS = ("samples", "adaptive_threshold", "denoise")


def _check_groups(groups: dict[str, list[str]]) -> None:
    """Check that no two light groups have the same emitter or equal names."""
    if not groups:
        raise ValueError("light_groups: must have one group or more")
    emitters: set[str] = set()
    names: set[str] = {light_groups.REST}
    for name, members in groups.items():
        if not re.fullmatch(light_groups.NAME_PATTERN, name):
            raise ValueError(
                f"light_groups: {name!r} is not a name of at most {light_groups.LONGEST_NAME} "
                "letters, digits, _ and -, with a letter or digit first"
            )
        if name.lower() in names:
            raise ValueError(f"light_groups: the name {name} is taken; choose another")
        names.add(name.lower())
        for emitter in members:
            if emitter in emitters:
                raise ValueError(f"light_groups: {emitter} is in two groups; must be in one")
            emitters.add(emitter)


class Render(RenderOptions):
    """The settings of Cycles.

    Without a value here, the .blend decides on max_bounces, clamp_indirect, light_tree, guiding,
    filter_width and motion_blur. All other keys have the defaults of this model.
    """

    @model_validator(mode="after")
    def _sum_of_groups(self) -> Self:
        """Check that light groups add up to the colour, which the denoiser would change."""
        if self.light_groups is None:
            return self
        if isinstance(self.light_groups, dict):
            _check_groups(self.light_groups)
        reason = "does not go with light_groups, which must add up to the colour"
        if self.denoise:
            raise ValueError(f"denoise: {reason}; leave it out, and take more samples")
        target = self.target_error
        if target is not None and not (
            isinstance(target, TargetError) and target.denoise == "never"
        ):
            raise ValueError(
                f"target_error: may choose to denoise, which {reason}; write "
                "{value: …, denoise: never}"
            )
        return self

    @model_validator(mode="after")
    def _plain_variance(self) -> Self:
        """Check that the variance is of plain samples, of which each part of them has some."""
        if not self.has_variance:
            return self
        reason = f"does not go with the pass {VARIANCE}"
        if self.denoise:
            raise ValueError(f"denoise: {reason}, because denoised pixels are no means of samples")
        if self.adaptive_threshold:
            raise ValueError(f"adaptive_threshold: {reason}, because it depends on the noise")
        if self.target_error is not None:
            raise ValueError(f"target_error: {reason}, because it may choose to denoise")
        if isinstance(self.samples, int) and self.samples < self.fewest_samples:
            raise ValueError(
                f"samples: is {self.samples}; must be at least {self.fewest_samples} for the pass "
                f"{VARIANCE}"
            )
        return self

    @model_validator(mode="after")
    def _samples_or_target(self) -> Self:
        if self.target_error is None and self.samples is None:
            raise ValueError("is missing the key samples (or target_error)")
        for name in CALIBRATED_KEYS:
            if self.target_error is not None and name in self.model_fields_set:
                raise ValueError(f"{name}: does not go with target_error, which chooses it")
        if self.camera_motion and "motion" in (self.passes or ()):
            raise ValueError("passes: motion does not go with camera_motion")
        return self
