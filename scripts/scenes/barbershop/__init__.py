"""A barbershop: a closed room in which no patch is bare, whatever way a camera looks.

The middle of the room is the world's origin and the floor z = 0. An aisle is kept free for the
camera rigs. The left wall (−X) has the barbers' stations, the right wall (+X) the waiting bench,
the front wall (+Y) the shop window and the door, the back wall (−Y) the reception desk.
"""

from collections.abc import Mapping
from typing import Any

from scenes.barbershop.coats import RACK, coats, umbrellas
from scenes.barbershop.fittings import FITTINGS, barber_pole, broom_and_bins, clock
from scenes.barbershop.floor import ON_THE_FLOOR, hair_clippings, medallion, rug, tiles
from scenes.barbershop.furniture import FURNITURE, desk_things, magazines, stocked_furniture
from scenes.barbershop.goods import bottles, pots
from scenes.barbershop.lamps import LAMPS, lights, sky
from scenes.barbershop.materials import palette
from scenes.barbershop.openings import OPENINGS, street, valance
from scenes.barbershop.plan import furnish
from scenes.barbershop.plants import HANGER, plants
from scenes.barbershop.prints import pictures
from scenes.barbershop.seats import STOOL, barber_chairs, chair_mats, waiting_bench
from scenes.barbershop.stations import STATION, mirrors, racks, station_goods
from scenes.barbershop.towels import towel_shelves
from scenes.barbershop.walls import WALLS, ceiling, metro_tiles, wainscot
from scenes.library.scene import Scene

DRAWN = (WALLS, ON_THE_FLOOR, OPENINGS, LAMPS, STATION, FURNITURE, STOOL, RACK, FITTINGS, HANGER)
"""What text alone draws (see `plan.furnish`)."""
ELEMENTS = (
    *(sky, lights, tiles, medallion, rug, hair_clippings),
    *(metro_tiles, wainscot, ceiling, valance, street),
    *(barber_chairs, chair_mats, waiting_bench, desk_things, magazines, mirrors, towel_shelves),
    *(coats, umbrellas, pictures, clock, barber_pole, broom_and_bins),
)
WITH_GOODS = (station_goods, racks, stocked_furniture, plants)


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the empty scene. parameters: `seed` (int), `detail` (1.0 is the full shop)."""
    scene = Scene(int(parameters["seed"]), float(parameters["detail"]), palette())
    for text in DRAWN:
        furnish(scene, text)
    for element in ELEMENTS:
        element(scene)
    goods = bottles(scene), pots(scene)
    for element in WITH_GOODS:
        element(scene, *goods)
