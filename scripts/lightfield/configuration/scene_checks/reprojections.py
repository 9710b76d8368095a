"""Checks reprojections with the rigs, passes and lights that they name."""

from lightfield.configuration.reprojections import LIGHT_GROUPS, ReprojectionEntry
from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.configuration.scene_checks.names import check_folder, check_rigs
from lightfield.core.names import IMU, MESH, RENDERED, VIDEO
from lightfield.formats import light_groups
from lightfield.formats.passes import FLOW, GROUP_PREFIX, PASSES, VARIANCE
from lightfield.settings.base import suggestion

# Names that a reprojection's folder cannot have.
_NEIGHBOURS = {
    "exr",
    "exports",
    IMU,
    MESH,
    "panorama",
    RENDERED,
    "report",
    "settings",
    VIDEO,
    FLOW.name,
    *PASSES,
}


def check(blocks: SceneBlocks) -> None:
    """Check all reprojections, also the ones that ``relight`` makes."""
    for name, reprojection in blocks.reprojections.items():
        block = "relight" if name in blocks.relight else "reprojections"
        neighbours = _NEIGHBOURS
        if name.startswith(GROUP_PREFIX) or (block == "relight" and name == light_groups.EACH):
            neighbours = {name}
        check_folder(f"{block}.{name}", name, neighbours)
        _check_reprojection(blocks, f"reprojections.{name}", reprojection)


def _check_reprojection(blocks: SceneBlocks, key: str, reprojection: ReprojectionEntry) -> None:
    """Check that a reprojection's rigs and passes exist."""
    check_rigs(blocks, f"{key}.rigs", reprojection.rigs or ())
    if reprojection.relight is not None:
        _check_light(blocks, key, reprojection)
    for pass_name in reprojection.passes or ():
        if pass_name == LIGHT_GROUPS:
            if blocks.render is None or blocks.render.light_groups is None:
                raise ValueError(f"{key}.passes: light_groups needs render.light_groups")
            continue
        if blocks.render is None or pass_name not in (blocks.render.passes or ()):
            raise ValueError(f"{key}.passes: {pass_name} is not in render.passes")
        if PASSES[pass_name].kind == "motion":
            raise ValueError(f"{key}.passes: motion is in pixels of the rendered lens")
        if pass_name == VARIANCE and reprojection.relight is not None:
            raise ValueError(f"{key}.passes: {VARIANCE} does not go with relight, which changes it")


def _check_light(blocks: SceneBlocks, key: str, reprojection: ReprojectionEntry) -> None:
    """Check that the groups of a light exist, as far as the scene YAML names them."""
    light = blocks.light_of(reprojection)
    at = f"{key}.relight"
    if isinstance(reprojection.relight, str) and reprojection.relight in blocks.relight:
        at = f"relight.{reprojection.relight}"
    if blocks.render is None or blocks.render.light_groups is None:
        raise ValueError(f"{at}: needs render.light_groups, whose strengths it changes")
    if light == light_groups.EACH:
        if reprojection.passes:
            raise ValueError(f"{key}.passes: does not go with the light each")
        return
    if isinstance(light, str):
        hint = suggestion(light, blocks.relight)
        raise ValueError(f"{at}: there is no relight.{light}{hint}")
    names = light_groups.names_in(blocks.render.light_groups)
    if names is not None:
        try:
            light_groups.weights(light, [*names, light_groups.REST])
        except ValueError as error:
            raise ValueError(f"{at}: {error}") from None
