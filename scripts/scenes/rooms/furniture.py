"""The pieces of furniture, and what takes them from their own scenes to their place in a room."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from scenes.barbershop import cloth, plants, prints, reception, seats
from scenes.barbershop import furniture as shop
from scenes.barbershop.plan import ORIGINAL as SHOP
from scenes.barbershop.plan import against, standing
from scenes.library.lights import point_light
from scenes.library.points import lattice
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import transform
from scenes.library.variation import Variation, move
from scenes.lone_monk import furniture as cloister
from scenes.lone_monk.plan import NORTH
from scenes.lone_monk.plan import ORIGINAL as CLOISTER
from scenes.rooms.plan import Room
from scenes.still_life import ELEMENTS as STILL_LIFE
from scenes.still_life.plan import drawn as drawn_still_life

Maker = Callable[[Scene], None]


@dataclass(frozen=True)
class Borrowed:
    """Elements of another scene, the frame in which they stand there, and that scene's plan."""

    elements: Sequence[Maker]
    frame: Matrix
    plan: Variation = SHOP


def table(scene: Scene) -> None:
    """A table 1.5 m long on four legs."""
    model = Model(scene)
    model.box(size=(1.5, 0.85, 0.035), bevel=0.008, at=(0, 0, 0.735), material="Room wood")
    model.box(size=(1.3, 0.65, 0.09), at=(0, 0, 0.67), material="Room wood")
    legs = lattice((-0.66, 0.66), (-0.34, 0.34), 0.36)
    model.box(size=(0.06, 0.06, 0.72), bevel=0.006, at=legs, material="Room wood")
    place("Table", model.mesh("Table"))


def sofa(scene: Scene) -> None:
    """A sofa 1.9 m wide. Its back is y = 0."""
    model = Model(scene)
    model.box(size=(1.9, 0.85, 0.3), bevel=0.05, segments=3, at=(0, 0.45, 0.25), material="Fabric")
    model.box(size=(1.9, 0.24, 0.75), bevel=0.08, segments=3, at=(0, 0.14, 0.45), material="Fabric")
    arms = lattice((-0.88, 0.88), 0.45, 0.36)
    model.box(size=(0.2, 0.85, 0.52), bevel=0.07, segments=3, at=arms, material="Fabric")
    seats_at = lattice((-0.39, 0.39), 0.54, 0.45)
    model.box(size=(0.76, 0.62, 0.15), bevel=0.05, segments=3, at=seats_at, material="Cushion")
    legs = lattice((-0.85, 0.85), (0.1, 0.8), 0.05)
    model.box(size=(0.05, 0.05, 0.1), at=legs, material="Room wood")
    place("Sofa", model.mesh("Sofa"))


def armchair(scene: Scene) -> None:
    model = Model(scene)
    model.box(size=(0.8, 0.75, 0.3), bevel=0.05, segments=3, at=(0, 0.4, 0.25), material="Cushion")
    model.box(size=(0.8, 0.2, 0.8), bevel=0.08, segments=3, at=(0, 0.12, 0.48), material="Cushion")
    arms = lattice((-0.34, 0.34), 0.42, 0.36)
    model.box(size=(0.15, 0.72, 0.5), bevel=0.06, segments=3, at=arms, material="Cushion")
    model.box(size=(0.55, 0.55, 0.14), bevel=0.05, segments=3, at=(0, 0.5, 0.44), material="Fabric")
    legs = lattice((-0.33, 0.33), (0.1, 0.7), 0.05)
    model.box(size=(0.05, 0.05, 0.1), at=legs, material="Room wood")
    place("Armchair", model.mesh("Armchair"))


def bed(scene: Scene) -> None:
    """A bed for two. Its head is y = 0."""
    model = Model(scene)
    model.box(size=(1.6, 0.06, 1.05), bevel=0.02, at=(0, 0.03, 0.525), material="Room wood")
    model.box(size=(1.6, 2.0, 0.3), bevel=0.02, at=(0, 1.06, 0.2), material="Room wood")
    model.box(size=(1.5, 1.95, 0.2), bevel=0.06, segments=3, at=(0, 1.06, 0.42), material="Linen")
    model.box(size=(1.66, 1.35, 0.12), bevel=0.05, segments=3, at=(0, 1.4, 0.5), material="Bedding")
    pillows = lattice((-0.38, 0.38), 0.35, 0.58)
    model.box(size=(0.62, 0.4, 0.13), bevel=0.06, segments=3, at=pillows, material="White towel")
    place("Bed", model.mesh("Bed"))


def bookshelf(scene: Scene) -> None:
    """A bookcase 1.1 m wide and 2 m high, with books of many sizes."""
    random = scene.random("books")
    model = Model(scene)
    model.box(size=(1.1, 0.02, 2.0), at=(0, 0.01, 1.0), material="Room wood")
    model.box(size=(0.03, 0.3, 2.0), at=lattice((-0.535, 0.535), 0.15, 1.0), material="Room wood")
    levels = np.linspace(0.05, 1.985, 6)
    model.box(size=(1.04, 0.3, 0.03), at=lattice(0, 0.15, levels), material="Room wood")
    for level in levels[:-1]:
        left = -0.5
        while left < 0.35 + 0.15 * random.random():
            thick = random.uniform(0.02, 0.055)
            tall = random.uniform(0.2, 0.31)
            deep = random.uniform(0.15, 0.22)
            at = (left + thick / 2, 0.03 + deep / 2, level + 0.016 + tall / 2)
            material = f"Book {random.integers(5)}"
            model.box(size=(thick, deep, tall), at=at, material=material)
            left += thick + 0.002
    place("Bookshelf", model.mesh("Bookshelf"))


def floor_lamp(scene: Scene) -> None:
    """A standing lamp with a globe that shines."""
    model = Model(scene)
    model.lathe(profile=[(0.15, 0), (0.15, 0.02), (0.02, 0.03)], material="Brass")
    model.tube(radius=0.012, path=[(0, 0, 0.02), (0, 0, 1.4)], material="Brass")
    model.ball(radius=0.14, at=(0, 0, 1.52), material="Opal globe")
    place("Floor lamp", model.mesh("Floor lamp"))
    point_light("Floor lamp light", (0, 0, 1.52), 12.0, scene.plan.light.lamp_color, 0.14)


def _plant(kind: str, size: float) -> Maker:
    def element(scene: Scene) -> None:
        place(kind, plants.plant(scene, kind), transform(scale=size))

    return element


def barber_chair(scene: Scene) -> None:
    where = standing(z=0.009)
    place("Barber chair", seats.chair_seat(scene), where)
    back = transform((0, -0.25, 0.58), (np.radians(14), 0, 0))
    place("Barber chair back", seats.chair_back(scene), where @ back)


def set_table(scene: Scene) -> None:
    """A still life of its own, on a table."""
    place_number = int(scene.random("still life").integers(10_000))
    plan = drawn_still_life(place_number)
    served = Scene(scene.seed, scene.detail, plan)
    for element in STILL_LIFE:
        if element.__name__ in ("lamps", "cloth", *plan.absent):
            continue
        earlier = set(bpy.data.objects)
        element(served)
        new = set(bpy.data.objects) - earlier
        plan.arrange(element.__name__, new)
        move(new, transform((0, 0, 0.7525 + 0.044)))


DESK = (reception.till, reception.desk_bell, reception.telephone, reception.card_box)
PIECES: dict[str, Maker | Borrowed] = {
    "table": table,
    "set table": set_table,
    "sofa": sofa,
    "armchair": armchair,
    "bed": bed,
    "bookshelf": bookshelf,
    "floor lamp": floor_lamp,
    "rubber tree": _plant("Rubber tree", 1.6),
    "snake plant": _plant("Snake plant", 1.4),
    "barber chair": barber_chair,
    "display cabinet": Borrowed((shop.display_cabinet, shop.hat_box), against("right", -1.65)),
    "cupboard": Borrowed(
        (shop.back_cupboard, shop.radio, shop.towel_steamer), against("back", 1.68)
    ),
    "coats": Borrowed(
        (cloth.coat_rack, cloth.fedora, cloth.bowler_hat, cloth.coats), against("right", 2.35)
    ),
    "umbrellas": Borrowed((cloth.umbrella_stand, cloth.umbrellas), against("right", 1.49)),
    "bench": Borrowed((seats.waiting_bench,), against("right", 0.15)),
    "low table": Borrowed((shop.low_table, shop.ashtray, shop.magazines), standing(x=1.24, y=0.15)),
    "desk": Borrowed(
        (reception.reception_desk, *DESK, reception.desk_things), standing(1.68, -2.45)
    ),
    "stool": Borrowed((seats.stool,), standing(1.45, -3.05)),
    "trolley": Borrowed((shop.trolley,), shop.TROLLEY),
    "chair": Borrowed((cloister.chair,), CLOISTER.side(NORTH, (*CLOISTER.chair, 0), -63), CLOISTER),
}


def furniture(scene: Scene[Room]) -> None:
    """Every piece at its place."""
    for each in scene.plan.furniture:
        piece = PIECES[each.name]
        there = transform((each.x, each.y, 0), (0, 0, np.radians(each.turned)))
        earlier = set(bpy.data.objects)
        if isinstance(piece, Borrowed):
            borrower = Scene(scene.seed, scene.detail, piece.plan)
            for element in piece.elements:
                element(borrower)
            there = there @ piece.frame.inverted()
        else:
            piece(scene)
        move(set(bpy.data.objects) - earlier, there)


def pictures(scene: Scene[Room]) -> None:
    """Some of the barbershop's framed prints on the walls."""
    earlier = set(bpy.data.objects)
    prints.pictures(Scene(scene.seed, scene.detail, SHOP))
    hung = sorted(set(bpy.data.objects) - earlier, key=lambda obj: obj.name)
    upright = transform(rotation=(np.pi / 2, 0, np.pi))
    for picture, obj in zip(scene.plan.pictures, hung, strict=False):
        obj.matrix_world = (
            scene.plan.at_wall(picture.wall, picture.along, 0.001, picture.z) @ upright
        )
    bpy.data.batch_remove(hung[len(scene.plan.pictures) :])
