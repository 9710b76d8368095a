"""The reception desk and the objects on it."""

from scenes.barbershop.goods import scattered
from scenes.barbershop.plan import INKS, put, standing
from scenes.library.points import evenly, lattice, mirrored
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box

DESK_PANEL = [(-0.06, 0.006), (-0.04, 0.022), (0, 0.024), (0.02, 0.008), (0.025, 0)]
KEY = [(0.004, 0), (0.004, 0.02), (0.012, 0.021), (0.012, 0.027), (0, 0.028)]  # of the till


def reception_desk(scene: Scene) -> None:
    """A mahogany desk with a marble top, turned columns and a rail for the feet."""
    desk = Model(scene)
    desk.box(size=(1.5, 0.5, 0.88), at=(0, 0, 0.52), material="Mahogany")
    desk.box(size=(1.42, 0.42, 0.08), at=(0, 0, 0.04), material="Ebony")
    desk.box(size=(1.58, 0.58, 0.04), bevel=0.012, segments=3, at=(0, 0, 0.98), material="Marble")
    desk.frame(
        size=(0.34, 0.56),
        profile=DESK_PANEL,
        at=lattice(x=evenly(-0.49, 0.49, 3), y=0.25, z=0.5),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    desk.frame(
        size=(0.34, 0.56),
        profile=DESK_PANEL,
        at=(-0.75, 0, 0.5),
        turned=(90, 0, -90),
        material="Mahogany",
    )
    desk.ring(
        radius=0.09,
        thickness=0.008,
        at=lattice(x=evenly(-0.49, 0.49, 3), y=0.256, z=0.5),
        turned=(90, 0, 0),
        material="Brass",
    )
    desk.word(
        letters="B",
        size=0.13,
        depth=0.01,
        at=lattice(x=evenly(-0.49, 0.49, 3), y=0.258, z=0.5),
        turned=(90, 0, 180),
        material="Brass",
    )
    desk.lathe(
        profile=[
            (0.03, 0.1),
            (0.035, 0.14),
            (0.022, 0.18),
            (0.026, 0.5),
            (0.022, 0.82),
            (0.035, 0.86),
            (0.03, 0.9),
        ],
        at=lattice(x=evenly(-0.735, 0.735, 4), y=0.25),
        material="Mahogany",
    )
    desk.tube(radius=0.017, path=[(-0.7, 0.34, 0.16), (0.7, 0.34, 0.16)], material="Brass")
    desk.tube(
        radius=0.009,
        path=[(0, 0.25, 0.12), (0, 0.34, 0.16)],
        at=lattice(x=evenly(-0.65, 0.65, 3)),
        material="Brass",
    )
    put(desk.mesh(name="Reception desk"), where=standing(x=1.68, y=-2.45))


def till(scene: Scene) -> None:
    """A cash register that shows a price above its rows of keys."""
    model = Model(scene)
    model.box(size=(0.42, 0.4, 0.12), bevel=0.008, segments=2, at=(0, 0, 0.06), material="Mahogany")
    model.box(size=(0.36, 0.006, 0.08), bevel=0.002, at=(0, 0.203, 0.06), material="Brass")
    model.lathe(
        profile=[(0.008, 0), (0.016, 0.014), (0, 0.022)],
        at=(0, 0.205, 0.06),
        turned=(-90, 0, 0),
        material="Brass",
    )
    model.prism(
        height=0.38,
        outline=[
            (-0.18, 0),
            (0.19, 0),
            (0.19, 0.05),
            (0.06, 0.16),
            (-0.02, 0.28),
            (-0.14, 0.3),
            (-0.18, 0.26),
        ],
        at=(-0.19, 0, 0.12),
        turned=(90, 0, 90),
        material="Gilt",
    )
    _till_keys(model)
    _till_display(model)
    _till_crank(model)
    put(model.mesh(name="Till"), where=standing(x=2.1, y=-2.47, z=1))


def _till_keys(model: Model) -> None:
    """Rows of keys on the slope: the last column is red."""
    model.lathe(
        profile=KEY,
        at=[
            *lattice(x=evenly(-0.14, 0.1, 7), y=0.17, z=0.186),
            *lattice(x=evenly(-0.14, 0.1, 7), y=0.14, z=0.2114),
            *lattice(x=evenly(-0.14, 0.1, 7), y=0.11, z=0.2368),
            *lattice(x=evenly(-0.14, 0.1, 7), y=0.08, z=0.2622),
        ],
        turned=(-40, 0, 0),
        material="Porcelain",
    )
    model.lathe(
        profile=KEY,
        at=[(0.14, 0.17, 0.186), (0.14, 0.14, 0.2114), (0.14, 0.11, 0.2368), (0.14, 0.08, 0.2622)],
        turned=(-40, 0, 0),
        material="Red",
    )


def _till_display(model: Model) -> None:
    """The price, over the keys."""
    model.box(size=(0.32, 0.1, 0.12), bevel=0.012, segments=2, at=(0, -0.09, 0.46), material="Gilt")
    model.box(size=(0.28, 0.11, 0.07), at=(0, -0.09, 0.465), material="Black")
    model.box(
        size=(0.05, 0.004, 0.055),
        at=lattice(x=evenly(-0.09, 0.09, 4), y=-0.033, z=0.465),
        material="White",
    )
    for x, letter in ((-0.09, "5"), (-0.03, "2"), (0.03, "."), (0.09, "1")):
        model.word(
            letters=letter,
            size=0.05,
            depth=0.0005,
            at=(x, -0.0305, 0.465),
            turned=(90, 0, 180),
            material="Black",
        )


def _till_crank(model: Model) -> None:
    """The crank at the side."""
    model.bend(
        radius=0.006,
        path=[(-0.19, 0, 0.25), (-0.225, 0, 0.25), (-0.225, 0.05, 0.3), (-0.225, 0.1, 0.33)],
        material="Chrome",
    )
    model.ball(radius=0.016, at=(-0.24, 0.1, 0.33), scaled=(1.6, 1, 1), material="Ebony")
    model.ring(
        radius=0.05,
        thickness=0.006,
        at=mirrored(x=0.19, y=-0.05, z=0.27),
        turned=(0, 90, 0),
        material="Brass",
    )


def desk_bell(scene: Scene) -> None:
    """A bell to strike with the palm."""
    bell = Model(scene)
    bell.lathe(profile=[(0.042, 0), (0.042, 0.008), (0.03, 0.012)], material="Ebony")
    bell.lathe(
        profile=[
            (0.04, 0.014),
            (0.038, 0.03),
            (0.025, 0.043),
            (0.006, 0.048),
            (0.004, 0.056),
            (0, 0.058),
        ],
        material="Brass",
    )
    put(bell.mesh(name="Desk bell"), where=standing(x=1.58, y=-2.33, z=1))


def telephone(scene: Scene) -> None:
    """A telephone with a dial, its receiver on the hook."""
    model = Model(scene)
    model.prism(
        height=0.18,
        outline=[(-0.1, 0), (0.1, 0), (0.1, 0.03), (0.03, 0.1), (-0.06, 0.11), (-0.1, 0.05)],
        at=(-0.09, 0, 0),
        turned=(90, 0, 90),
        material="Black",
    )
    model.lathe(
        profile=[(0.055, 0), (0.052, 0.01), (0.02, 0.014), (0, 0.014)],
        at=(0, 0.066, 0.066),
        turned=(-45, 0, 0),
        material="Steel",
    )
    model.ball(
        radius=0.008,
        at=[
            *mirrored(x=0.037, y=0.0724, z=0.0724),
            *mirrored(x=0.0185, y=0.095, z=0.0497),
            *mirrored(x=0.0185, y=0.05, z=0.095),
        ],
        material="White",
    )
    model.bend(
        radius=0.014,
        path=[
            (-0.12, -0.03, 0.14),
            (-0.08, -0.03, 0.155),
            (0.08, -0.03, 0.155),
            (0.12, -0.03, 0.14),
        ],
        material="Black",
    )
    model.lathe(
        profile=[(0.03, 0), (0.032, 0.02), (0.015, 0.04)],
        at=mirrored(x=0.115, y=-0.03, z=0.105),
        material="Black",
    )
    model.box(size=(0.1, 0.03, 0.03), bevel=0.008, at=(0, -0.03, 0.12), material="Black")
    put(model.mesh(name="Telephone"), where=standing(x=1.7, y=-2.55, z=1, turned=160))


def card_box(scene: Scene) -> None:
    """A box of the shop's cards."""
    model = Model(scene)
    model.box(size=(0.1, 0.06, 0.025), bevel=0.003, at=(0, 0, 0.0125), material="Oak")
    model.box(
        size=(0.085, 0.001, 0.05),
        at=lattice(y=evenly(-0.02, 0.004, 3), z=0.045),
        turned=(12, 0, 0),
        material="White",
    )
    model.box(
        size=(0.085, 0.001, 0.05),
        at=lattice(y=evenly(-0.014, 0.01, 3), z=0.045),
        turned=(12, 0, 0),
        material="Paper",
    )
    put(model.mesh(name="Card box"), where=standing(x=1.32, y=-2.33, z=1, turned=12))


def desk_things(scene: Scene) -> None:
    """A jar of lollies on the desk, and an open appointment book with a pen."""
    lolly_jar(scene)
    appointment_book(scene)


def lolly_jar(scene: Scene) -> None:
    """A glass jar of lollies in the colours of the inks."""
    jar = Model(scene)
    random = scene.random("lollies")
    jar.lathe(profile=[(0.064, 0), (0.064, 0.004)], material="Steel")
    jar.pipe(profile=[(0.06, 0.004), (0.07, 0.02), (0.07, 0.14), (0.05, 0.17)], material="Pane")
    stick = scene.tube([(0, 0, 0), (0, 0, 0.07)], 0.0015, 5)
    for k, at in enumerate(scattered(random, scene.count(40, 6), 0.055, 0.02, 0.13)):
        jar.add(scene.ball(0.013, 10), INKS[k % 6], at)
        jar.add(stick, "White", at, random.uniform(-25, 25, 3))
    put(jar.mesh(name="Lolly jar"), where=standing(x=1.1, y=-2.39, z=1))


def appointment_book(scene: Scene) -> None:
    """An open book, its lines written as bars, with a pen."""
    book = Model(scene)
    random = scene.random("ledger")
    book.box(size=(0.36, 0.25, 0.006), bevel=0.002, at=(0, 0, 0.003), material="Oxblood")
    book.box(
        size=(0.17, 0.235, 0.012),
        bevel=0.003,
        at=(-0.087, 0, 0.012),
        turned=(0, -2, 0),
        material="Paper",
    )
    book.box(
        size=(0.17, 0.235, 0.012),
        bevel=0.003,
        at=(0.087, 0, 0.012),
        turned=(0, 2, 0),
        material="Paper",
    )
    book.tube(radius=0.004, path=[(0.02, -0.06, 0.026), (0.13, 0.03, 0.024)], material="Black")
    for side in (-1, 1):
        for k in range(14):
            width = random.uniform(0.05, 0.14) if k else 0.13
            at = (side * 0.085 - (0.14 - width) / 2, 0.1 - 0.015 * k, 0.0195)
            ink = "Navy" if k else "Red"
            book.add(box((width, 0.003, 0.0006)), ink, at, (0, side * 2, 0))
    put(book.mesh(name="Appointment book"), where=standing(x=1.35, y=-2.53, z=1, turned=-8))
