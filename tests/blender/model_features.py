"""The features of OBJ, PLY and STL, and what becomes of each: data for a test and a table.

tests/rendering/test_model_features.py imports each case. Run this file to write the tables in
docs/reference/model-formats.md anew: ``python tests/blender/model_features.py``.

To add a feature, add a `Case` to the row of `ROWS` that says the same of it, or add a row.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "model-formats.md"
# Each table is between these lines of the page.
BEGIN = "<!-- {} Written by tests/blender/model_features.py. Change its rows instead. -->"
END = "<!-- End of the table. -->"

SHOWN, NOTED, REFUSED, IGNORED = "shown", "noted", "refused", "ignored"
# The linear value of sRGB 128 of 255, by IEC 61966-2-1.
MIDDLE = 0.21586


@dataclass(frozen=True)
class Case:
    """A model with a feature. Without it, the model is a grey square.

    - ``model``: the content of the file.
    - ``library``: the content of the OBJ's library of materials. "" if it has none.
    - ``seen``: the linear colour and alpha of the square (4,). None if it is no matter.
    - ``inputs``: values of the inputs of the Principled BSDF by name. A name of a node's type says
      that such a node gives the value.
    - ``box``: the largest coordinates of the model. None if they are 1, 1 and 0.
    - ``said``: a part of the note or of the error.
    """

    model: str | bytes
    library: str = ""
    seen: tuple[float, ...] | None = None
    inputs: Mapping[str, Any] = field(default_factory=dict)
    box: tuple[float, ...] = (1, 1, 0)
    said: str = ""


@dataclass(frozen=True)
class Row:
    """A line of a table: features, what becomes of them, a remark, and their cases."""

    features: str
    outcome: str
    cases: list[Case]
    remark: str = ""


# ---- OBJ ------------------------------------------------------------------------------------

PLACES = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
SQUARE = f"{PLACES}f 1 2 3 4\n"
# With a material, and with its middle in the middle of a texture.
PAINTED = f"{PLACES}vt 0.5 0.5\nusemtl red\nf 1/1 2/1 3/1 4/1\n"
GREY = (0.5, 0.5, 0.5, 1)


def obj(*lines: str) -> Case:
    return Case(SQUARE + "".join(f"{line}\n" for line in lines))


def noted(said: str, *lines: str) -> Case:
    return Case(SQUARE + "".join(f"{line}\n" for line in lines), said=said)


def material(*lines: str, **facts: Any) -> Case:
    return Case(PAINTED, "newmtl red\n" + "".join(f"{line}\n" for line in lines), **facts)


OBJ = [
    Row(
        "vertices `v`, faces `f` of any number of corners, also by negative numbers",
        SHOWN,
        [Case(SQUARE), Case(f"{PLACES}f -4 -3 -2 -1\n"), Case(f"{PLACES}f 1 2 3\nf 1 3 4\n")],
    ),
    Row(
        "places in textures `vt`, normals `vn`, smoothing `s`",
        SHOWN,
        [Case(f"{PLACES}vt 0 0\nvn 0 0 1\ns 1\nf 1/1/1 2/1/1 3//1 4//1\n")],
    ),
    Row(
        "a place that is not three numbers, a face whose vertices do not exist",
        REFUSED,
        [
            Case(SQUARE.replace("1 1 0", "1 1 nan"), said="number"),
            Case(f"{SQUARE}f 1 2 99\n", said="does not exist"),
        ],
    ),
    Row(
        "colours after the places of vertices",
        SHOWN,
        [
            Case(
                "".join(f"{line} 1 0.50196 0\n" for line in PLACES.splitlines()) + "f 1 2 3 4\n",
                seen=(1, MIDDLE, 0, 1),
            )
        ],
        "where faces have no material. Otherwise they are noted",
    ),
    Row(
        "objects `o`",
        SHOWN,
        [Case(f"o a\n{SQUARE}o b\nv 2 0 0\nv 2 1 0\nf 2 5 6\n", box=(2, 1, 0))],
    ),
    Row("groups `g`, comments, weights of vertices", IGNORED, [obj("g a b", "# c", "v 0 0 0 2")]),
    Row("points `p`, lines `l`", NOTED, [noted("points", "p 1"), noted("lines", "l 1 2")]),
    Row(
        "free-form curves `curv`, `curv2`",
        NOTED,
        [noted("curv", "cstype bezier", "deg 3", "curv 0 1 1 2 3 4", "end")],
    ),
    Row(
        "free-form surfaces `surf`, patches `bsp`, `bzp`, `cdc`, `res`; `call` and `csh`",
        REFUSED,
        [noted(word, f"{word} 1 2 3 4") for word in ("surf", "bsp", "bzp", "cdc", "res")]
        + [noted("call", "call b.obj"), noted("csh", "csh ls")],
    ),
    Row(
        "`bevel`, `c_interp`, `d_interp`, `lod`, `shadow_obj`, `trace_obj`, `maplib`, `usemap`",
        NOTED,
        [
            noted(word, f"{word} 1")
            for word in ("bevel", "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj")
        ]
        + [noted(word, f"{word} a") for word in ("maplib", "usemap")],
    ),
    Row(
        "libraries `mtllib`, materials `usemtl`",
        SHOWN,
        [material("Kd 1 0 0", seen=(1, 0, 0, 1))],
        "A missing library is refused, and a material that no library has is noted",
    ),
    Row("", NOTED, [Case(PAINTED, said="red")]),
]
MTL = [
    Row(
        "colour `Kd`, `map_Kd`",
        SHOWN,
        [
            material("Kd 1 0.5 0", seen=(1, 0.5, 0, 1)),
            material("map_Kd red.png", seen=(1, 0, 0, 1)),
        ],
        "A texture takes the place of `Kd`",
    ),
    Row(
        "`Kd` as a spectrum, in XYZ, or with one number",
        REFUSED,
        [
            material(line, said="of the material red")
            for line in ("Kd spectral a.rfl", "Kd xyz 1 1 1", "Kd 0.3")
        ],
    ),
    Row(
        "opacity `d`, `Tr`",
        SHOWN,
        [
            material("d 0.25", seen=(None, None, None, 0.25)),
            material("Tr 0.25", seen=(None, None, None, 0.75)),
        ],
        "`d` counts if a material has both",
    ),
    Row(
        "opacity by a texture `map_d`",
        SHOWN,
        [
            material("map_d grey.png", seen=(None, None, None, 128 / 255)),
            material("map_d clear.png", seen=(None, None, None, 64 / 255)),
        ],
        "the alpha of a picture that has one, or else its luminance",
    ),
    Row("opacity by the angle `d -halo`", REFUSED, [material("d -halo 0.5", said="-halo")]),
    Row(
        "`Ks`, `map_Ks`, `Ns`, `map_Ns`, `Ke`, `map_Ke`, `Ni`",
        SHOWN,
        [
            material("Ks 0.9 0.9 0.9", inputs={"Specular IOR Level": 0.9}),
            material("map_Ks red.png", inputs={"Specular IOR Level": "ShaderNodeTexImage"}),
            material("Ns 1000", inputs={"Roughness": 0}),
            material("map_Ns red.png", inputs={"Roughness": "ShaderNodeTexImage"}),
            material("Ke 1 1 1", inputs={"Emission Strength": 1}),
            material("map_Ke red.png", inputs={"Emission Color": "ShaderNodeTexImage"}),
            material("Ni 1.7", inputs={"IOR": 1.7}),
        ],
        "as the inputs of a Principled BSDF",
    ),
    Row(
        "`Pr`, `map_Pr`, `Pm`, `map_Pm`, `Ps`, `map_Ps`, `Pc`, `Pcr`, `aniso`, `anisor`",
        SHOWN,
        [
            material("Pr 0.2", inputs={"Roughness": 0.2}),
            material("map_Pr red.png", inputs={"Roughness": "ShaderNodeTexImage"}),
            material("Pm 0.7", inputs={"Metallic": 0.7}),
            material("map_Pm red.png", inputs={"Metallic": "ShaderNodeTexImage"}),
            material("Ps 0.3", inputs={"Sheen Weight": 0.3}),
            material("map_Ps red.png", inputs={"Sheen Weight": "ShaderNodeTexImage"}),
            material("Pcr 0.5", inputs={"Coat Roughness": 0.5}),
            material("aniso 0.3", inputs={"Anisotropic": 0.3}),
            material("anisor 0.2", inputs={"Anisotropic Rotation": 0.2}),
        ],
        "as the inputs of a Principled BSDF",
    ),
    Row(
        "normals `norm`, bumps `bump`, `map_Bump`",
        SHOWN,
        [
            material(f"{word} red.png", inputs={"Normal": "ShaderNodeNormalMap"})
            for word in ("norm", "bump", "map_Bump")
        ],
        "as a texture of normals. Heights are not told from normals",
    ),
    Row(
        "illumination `illum`",
        SHOWN,
        [
            material("illum 2", inputs={"Metallic": 0}),
            material("illum 3", inputs={"Metallic": 1}),
        ],
        "3 to 8 as metal",
    ),
    Row(
        "light that passes through `Tf`",
        SHOWN,
        [
            material("illum 4", "Tf 1 1 1", inputs={"Transmission Weight": 1}),
            material("illum 2", "Tf 1 1 1", inputs={"Transmission Weight": 0}),
        ],
        "if `illum` is 4, 6, 7 or 9. Its colours are noted",
    ),
    Row("", NOTED, [material("illum 4", "Tf 0 1 0", said="Tf")]),
    Row(
        "`map_Ka`, `map_Tr`, `map_Pc`, `map_Pcr`, `map_aniso`, `disp`, `decal`, `refl`, `map_aat`, "
        "`sharpness`",
        NOTED,
        [
            material(f"{word} red.png", said=word)
            for word in ("map_Ka", "map_Tr", "map_Pc", "map_Pcr", "map_aniso", "disp", "decal")
        ]
        + [material("refl red.png", said="refl"), material("map_aat on", said="map_aat")]
        + [material("sharpness 60", said="sharpness")],
    ),
    Row("ambient colour `Ka`", IGNORED, [material("Kd 0.5 0.5 0.5", "Ka 1 0 0", seen=GREY)]),
    Row(
        "options of textures: `-o`, `-s`, `-bm`",
        SHOWN,
        [material("map_Kd -o 0.1 0 0 -s 2 2 1 red.png", seen=(1, 0, 0, 1))],
    ),
    Row(
        "options of textures: `-mm`, `-clamp`, `-cc`, `-imfchan`",
        NOTED,
        [
            material(f"map_Kd {option} red.png", said=option)
            for option in ("-mm 0.1 2", "-clamp on", "-cc on", "-imfchan r")
        ],
        "if they change something",
    ),
    Row(
        "options of textures: `-colorspace`",
        REFUSED,
        [material("map_Kd -colorspace acescg red.png", said="acescg")],
        "if it is not sRGB",
    ),
    Row(
        "options of textures: `-blendu`, `-blendv`, `-boost`, `-t`, `-texres`, `-type`",
        IGNORED,
        [material("map_Kd -blendu on -boost 2 -t 1 1 1 -texres 64 red.png", seen=(1, 0, 0, 1))],
    ),
]

# ---- PLY ------------------------------------------------------------------------------------

VERTICES = ("0 0 0", "1 0 0", "1 1 0", "0 1 0")
TEXTURE = "comment TextureFile red.png\n"


def properties(kind: str, *names: str) -> str:
    return "".join(f"property {kind} {name}\n" for name in names)


def ply(
    of_vertices: str = "",
    of_faces: str = "",
    vertex: str = "",
    face: str = "",
    faces: tuple[str, ...] = ("4 0 1 2 3",),
    comment: str = "",
    more: str = "",
    rows: str = "",
) -> str:
    """Return a text of a square with more properties of vertices and faces, and their values."""
    head = f"ply\nformat ascii 1.0\n{comment}element vertex 4\n{properties('float', *'xyz')}"
    head += f"{vertex}element face {len(faces)}\nproperty list uchar int vertex_indices\n{face}"
    lines = [f"{line} {of_vertices}\n" for line in VERTICES]
    lines += [f"{line} {of_faces}\n" for line in faces]
    return f"{head}{more}end_header\n{''.join(lines)}{rows}"


def binary_ply(order: str, name: str) -> bytes:
    head = f"ply\nformat {name} 1.0\nelement vertex 4\n{properties('double', *'xyz')}element face 2"
    head += "\nproperty list uchar ushort vertex_index\nend_header\n"
    places = [float(number) for line in VERTICES for number in line.split()]
    faces = struct.pack(f"{order}B4HB3H", 4, 0, 1, 2, 3, 3, 0, 2, 1)
    return head.encode() + struct.pack(f"{order}12d", *places) + faces


STRIP = ply(faces=("4 0 1 3 2",)).replace("element face", "element tristrips")
COLOURS = ("red", "green", "blue")
PLY = [
    Row(
        "text, and binary of both byte orders; all types of numbers",
        SHOWN,
        [
            Case(ply()),
            Case(binary_ply("<", "binary_little_endian")),
            Case(binary_ply(">", "binary_big_endian")),
        ],
    ),
    Row(
        "faces `vertex_indices` or `vertex_index` of any number of corners; `tristrips`",
        SHOWN,
        [Case(ply(faces=("3 0 1 2", "3 0 2 3"))), Case(STRIP)],
    ),
    Row(
        "a place that is not a number, a face whose vertices do not exist, missing values",
        REFUSED,
        [
            Case(ply().replace("1 1 0", "1 1 inf"), said="not numbers"),
            Case(ply(faces=("4 0 1 2 9",)), said="do not exist"),
            Case(ply(faces=("4 0 1 2",)), said="cut short"),
        ],
    ),
    Row(
        "faces that repeat a corner or another face",
        NOTED,
        [Case(ply(faces=("4 0 1 2 3", "3 0 0 1")), said="1 of 2 faces")],
        "Refused, if Blender leaves out a part that can be seen",
    ),
    Row("", REFUSED, [Case(ply(faces=("4 0 1 2 2", "3 0 2 3")), said="2 triangles")]),
    Row(
        "normals `nx ny nz`",
        SHOWN,
        [Case(ply("0 0 1", vertex=properties("float", "nx", "ny", "nz")))],
    ),
    Row(
        "colours of vertices or faces: `red`, `diffuse_red` or `r`, and so on",
        SHOWN,
        [
            Case(ply("255 128 0", vertex=properties("uchar", *names)), seen=(1, MIDDLE, 0, 1))
            for names in (COLOURS, tuple(f"diffuse_{name}" for name in COLOURS), tuple("rgb"))
        ]
        + [
            Case(
                ply(of_faces="255 128 0", face=properties("uchar", *COLOURS)),
                seen=(1, MIDDLE, 0, 1),
            )
        ],
        "as sRGB",
    ),
    Row(
        "`alpha` of vertices",
        NOTED,
        [Case(ply("9 9 9 9", vertex=properties("uchar", *COLOURS, "alpha")), said="alpha")],
    ),
    Row(
        "`comment TextureFile`, with `s t`, `texture_u texture_v` or `u v` of vertices, or with "
        "`texcoord` and `texnumber` of faces",
        SHOWN,
        [
            Case(
                ply("0.5 0.5", vertex=properties("float", *names), comment=TEXTURE),
                seen=(1, 0, 0, 1),
            )
            for names in ("st", "uv", ("texture_u", "texture_v"))
        ]
        + [
            Case(
                ply(
                    of_faces="8 0 0 1 0 1 1 0 1 1",
                    face=properties("list uchar float", "texcoord") + "property int texnumber\n",
                    comment="comment TextureFile grey.png\n" + TEXTURE,
                ),
                seen=(1, 0, 0, 1),
            )
        ],
        "Colours beside a texture are noted",
    ),
    Row(
        "a texture that is missing, or has no place",
        REFUSED,
        [
            Case(ply(comment=TEXTURE), said="red.png"),
            Case(
                ply("0 0", vertex=properties("float", *"st"), comment=TEXTURE.replace("red", "x")),
                said="x.png",
            ),
        ],
    ),
    Row(
        "`edge` and other elements",
        NOTED,
        [
            Case(
                ply(
                    more=f"element {name} 1\n{properties('int', 'vertex1', 'vertex2')}",
                    rows="0 1\n",
                ),
                said=name,
            )
            for name in ("edge", "material")
        ],
    ),
    Row(
        "other properties, `comment`, `obj_info`",
        IGNORED,
        [Case(ply("3", vertex=properties("float", "quality"), comment="obj_info a\n"), seen=GREY)],
    ),
]

# ---- STL ------------------------------------------------------------------------------------

FACETS = ((0, 0, 0, 1, 0, 0, 1, 1, 0), (0, 0, 0, 1, 1, 0, 0, 1, 0))


def stl(head: bytes = b"", attribute: int = 0, facets: Any = FACETS) -> bytes:
    rows = [struct.pack("<12fH", 0, 0, 1, *places, attribute) for places in facets]
    return head.ljust(80) + struct.pack("<I", len(rows)) + b"".join(rows)


def text_stl(*facets: tuple[float, ...]) -> str:
    rows = [
        "facet normal 0 0 1\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*places[n : n + 3]) for n in (0, 3, 6))
        + "endloop\nendfacet\n"
        for places in facets
    ]
    return f"solid a\n{''.join(rows)}endsolid a\n"


STL = [
    Row(
        "text, also of several solids, and binary",
        SHOWN,
        [
            Case(text_stl(*FACETS)),
            Case(text_stl(FACETS[0]) + text_stl(FACETS[1])),
            Case(stl()),
        ],
    ),
    Row(
        "a place that is not a number, a missing part",
        REFUSED,
        [
            Case(text_stl(*FACETS).replace("1 1 0", "1 1 nan"), said="number"),
            Case(stl()[:-20], said="cut short"),
        ],
    ),
    Row(
        "colours of facets as VisCAM and SolidView write them",
        SHOWN,
        [Case(stl(attribute=0x8000 | 31 << 10), seen=(1, 0, 0, 1))],
        "A facet without a colour is grey",
    ),
    Row(
        "colours of facets, and of all, as Materialise Magics writes them",
        SHOWN,
        [
            Case(stl(b"COLOR=\xff\x80\x00\xff", 31), seen=(1, 0, 0, 1)),
            Case(stl(b"COLOR=\xff\x80\x00\xff", 0x8000), seen=(1, MIDDLE, 0, 1)),
        ],
    ),
    Row(
        "facets that repeat a corner or another facet",
        NOTED,
        [Case(stl(facets=(*FACETS, FACETS[0])), said="1 of 3 facets")],
    ),
    Row("normals of facets, names of solids", IGNORED, [Case(stl(b"a name"), seen=GREY)]),
]

ROWS = {"OBJ": ("obj", OBJ), "MTL": ("obj", MTL), "PLY": ("ply", PLY), "STL": ("stl", STL)}


def table(rows: list[Row]) -> str:
    """Return the table of rows, as Markdown. Rows without a name have cases of other remarks."""
    lines = ["| in the file | what becomes of it |", "| --- | --- |"]
    for row in filter(lambda row: row.features, rows):
        # A remark that begins with a capital is a sentence.
        sentence = row.remark[:1].isupper() or row.remark.startswith("`")
        separator = (". " if sentence else ", ") if row.remark else ""
        lines.append(f"| {row.features} | {row.outcome}{separator}{row.remark} |")
    return "\n".join(lines)


def page(text: str) -> str:
    """Return the text of the page with the present tables."""
    for name, (_, rows) in ROWS.items():
        begin = BEGIN.format(name)
        before, _, rest = text.partition(begin)
        _, _, after = rest.partition(END)
        text = f"{before}{begin}\n{table(rows)}\n{END}{after}"
    return text


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
