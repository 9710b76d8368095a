"""The rooms' materials: those of the pieces' own scenes, and of floors, walls and furniture."""

from scenes.barbershop import materials as barbershop
from scenes.library.materials import MaterialGraph, plain, wood
from scenes.lone_monk import materials as lone_monk
from scenes.still_life import materials as still_life


def palette() -> None:
    """All materials. Of equal names in several scenes, the first is used."""
    barbershop.palette()
    still_life.palette()
    lone_monk.palette()
    wood("Floor boards", (0.20, 0.10, 0.045), (0.42, 0.25, 0.12), 0.35, along="Y")
    wood("Room wood", (0.16, 0.075, 0.032), (0.36, 0.19, 0.085), 0.4)
    plain("Paint", (0.74, 0.71, 0.65), Roughness=0.85)
    plain("Ceiling paint", (0.82, 0.81, 0.78), Roughness=0.9)
    plain("Joinery", (0.78, 0.76, 0.72), Roughness=0.4)
    plain("Carpet", (0.24, 0.20, 0.17), Roughness=1.0, Sheen_Weight=0.4)
    for name in ("Fabric", "Cushion", "Bedding"):
        plain(name, (0.45, 0.42, 0.38), Roughness=0.95, Sheen_Weight=0.3)
    for number, color in enumerate(
        [
            (0.35, 0.05, 0.04),
            (0.04, 0.10, 0.22),
            (0.05, 0.14, 0.07),
            (0.5, 0.4, 0.25),
            (0.06, 0.05, 0.05),
        ]
    ):
        plain(f"Book {number}", color, Roughness=0.6)
    checks()


def checks() -> None:
    """Floor tiles of two colours, 0.3 m wide."""
    graph = MaterialGraph("Checks")
    tints = {"Color1": (0.62, 0.58, 0.50), "Color2": (0.10, 0.10, 0.11)}
    inputs = {"Vector": graph.geometry("Position"), "Scale": 1 / 0.3} | tints
    graph.finish(graph.principled(Base_Color=graph.add("TexChecker", inputs), Roughness=0.2))
