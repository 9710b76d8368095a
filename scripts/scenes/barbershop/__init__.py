"""A barbershop: a closed room without a bare patch in any direction.

The middle of the room is the world's origin and the floor z = 0. An aisle is free for the camera
rigs. The left wall (−X) has the barbers' stations, the right wall (+X) the waiting bench. The front
wall (+Y) has the shop window and the door, the back wall (−Y) the reception desk.
"""

from functools import partial

import bpy

from scenes.barbershop import (
    cloth,
    fittings,
    furniture,
    lamps,
    openings,
    plants,
    prints,
    reception,
    room,
    seats,
    stations,
)
from scenes.barbershop.goods import bottles, pots
from scenes.barbershop.materials import palette
from scenes.barbershop.place import drawn
from scenes.barbershop.plan import ORIGINAL, Barbershop
from scenes.library.scene import Scene, fill


def stocked(scene: Scene[Barbershop]) -> None:
    """The goods at the stations, in the cabinet, behind the desk, and the plants between them."""
    bottle_meshes = bottles(scene)
    pot_meshes = pots(scene)
    stations.station_goods(scene, bottle_meshes, pot_meshes)
    stations.racks(scene, bottle_meshes, pot_meshes)
    random = scene.random("stock")
    for owner, goods in (
        (furniture.display_cabinet, furniture.cabinet_goods),
        (furniture.back_cupboard, furniture.desk_goods),
        (furniture.trolley, furniture.trolley_goods),
    ):
        if owner.__name__ not in scene.plan.absent:
            earlier = set(bpy.data.objects)
            goods(scene, random, bottle_meshes, pot_meshes)
            scene.plan.arrange(owner.__name__, set(bpy.data.objects) - earlier)
    plants.plants(scene, bottle_meshes)


ELEMENTS = (
    room.walls,
    room.wall_lettering,
    room.grout,
    room.beam,
    room.picture_rail,
    room.palmette,
    room.entrance_mat,
    room.floor_drain,
    lamps.pendant_lamp,
    lamps.fan_motor,
    lamps.fan_blade,
    lamps.wall_lamp,
    lamps.lights,
    room.tiles,
    room.medallion,
    room.rug,
    room.hair_clippings,
    room.metro_tiles,
    room.wainscot,
    room.ceiling,
    openings.window_frame,
    openings.window_pane,
    openings.window_letters,
    openings.door_frame,
    openings.door,
    openings.door_pane,
    openings.transom_pane,
    openings.door_sign,
    openings.door_bell,
    openings.house_number,
    openings.staff_door_frame,
    openings.staff_door,
    openings.street_lamp,
    openings.valance,
    openings.street,
    reception.reception_desk,
    reception.till,
    reception.desk_bell,
    reception.telephone,
    reception.card_box,
    reception.desk_things,
    seats.stool,
    seats.barber_chairs,
    seats.waiting_bench,
    furniture.low_table,
    furniture.ashtray,
    furniture.magazines,
    furniture.trolley,
    furniture.display_cabinet,
    furniture.hat_box,
    furniture.back_cupboard,
    furniture.radio,
    furniture.towel_steamer,
    stations.counter_drawers,
    stations.counter_doors,
    stations.counter_top,
    stations.bulb_strip,
    stations.mirror_tube,
    stations.basin,
    stations.tap,
    stations.tool_mat,
    stations.towel_rail,
    stations.mirrors,
    cloth.towel_shelves,
    cloth.coat_rack,
    cloth.umbrella_stand,
    cloth.fedora,
    cloth.bowler_hat,
    cloth.coats,
    cloth.umbrellas,
    prints.pictures,
    fittings.radiator_section,
    fittings.radiator_pipes,
    fittings.switch,
    fittings.vent,
    fittings.dustpan,
    fittings.clock,
    fittings.barber_pole,
    fittings.broom,
    fittings.waste_bins,
    plants.plant_cord,
    plants.plant_hook,
    stocked,
)
build = partial(fill, palette, ELEMENTS, drawn=drawn, original=ORIGINAL)
