"""Write firmware/core/frames.h and frames.c from src/swingid/live/swingid.dbc.

Own few lines in place of cantools' generator: that makes one named number of each element of an array and 2700 lines
of shifts and masks, where every field here is a whole number of bytes. `tests/live/test_live_frames.py` compares
what both put into a frame, and that the files are those of the schema.
"""

from __future__ import annotations

from pathlib import Path

from swingid.live import codes
from swingid.live.schema import MOST_PAYLOAD, Message, Schema, schema

CORE = Path(__file__).resolve().parents[1] / "firmware" / "core"
TYPES = {"B": ("uint8_t", "u8", 1), "H": ("uint16_t", "u16", 2), "I": ("uint32_t", "u32", 4)}
TYPES |= {"i": ("int32_t", "i32", 4), "f": ("float", "f32", 4), "d": ("double", "f64", 8)}
NOTE = "/* Made by tools/generate_frames.py from src/swingid/live/swingid.dbc; change that. */\n"
ENUMS = (codes.State, codes.FaultCode, codes.Status, codes.StopMode, codes.Mode, codes.Flag)

HELPERS = """
static void put_u8(uint8_t *p, uint8_t x) { p[0] = x; }
static void put_u16(uint8_t *p, uint16_t x) {
    p[0] = (uint8_t)x;
    p[1] = (uint8_t)(x >> 8);
}
static void put_u32(uint8_t *p, uint32_t x) {
    put_u16(p, (uint16_t)x);
    put_u16(p + 2, (uint16_t)(x >> 16));
}
static void put_i32(uint8_t *p, int32_t x) { put_u32(p, (uint32_t)x); }
static void put_f32(uint8_t *p, float x) {
    union {
        float number;
        uint32_t bits;
    } same;
    same.number = x;
    put_u32(p, same.bits);
}
void swingid_put_f64(uint8_t *p, double x) {
    union {
        double number;
        uint64_t bits;
    } same;
    same.number = x;
    put_u32(p, (uint32_t)same.bits);
    put_u32(p + 4, (uint32_t)(same.bits >> 32));
}
#define put_f64 swingid_put_f64

static uint8_t get_u8(const uint8_t *p) { return p[0]; }
static uint16_t get_u16(const uint8_t *p) { return (uint16_t)(p[0] | (uint16_t)(p[1] << 8)); }
static uint32_t get_u32(const uint8_t *p) { return get_u16(p) | (uint32_t)get_u16(p + 2) << 16; }
static int32_t get_i32(const uint8_t *p) { return (int32_t)get_u32(p); }
static float get_f32(const uint8_t *p) {
    union {
        float number;
        uint32_t bits;
    } same;
    same.bits = get_u32(p);
    return same.number;
}
static double get_f64(const uint8_t *p) {
    union {
        double number;
        uint64_t bits;
    } same;
    same.bits = get_u32(p) | (uint64_t)get_u32(p + 4) << 32;
    return same.number;
}
"""


def named(message: Message) -> list[tuple[str, int, str, int]]:
    """(name, count, code, first byte) of the fields that are not reserved."""
    found, place = [], 0
    for name, count, code in message.fields:
        if name != "reserved":
            found.append((name, count, code, place))
        place += TYPES[code][2] * (count or 1)
    return found


def header(known: Schema) -> str:
    """Text of frames.h."""
    lines = [NOTE + "#ifndef SWINGID_FRAMES_H\n#define SWINGID_FRAMES_H\n\n#include <stdint.h>\n"]
    lines += [f"#define SWINGID_SCHEMA {known.hash}u", f"#define SWINGID_MOST_PAYLOAD {MOST_PAYLOAD}\n"]
    for kind in ENUMS:
        words = [f"    SWINGID_{kind.__name__.upper()}_{one.name} = {one.value}" for one in kind]
        lines.append("enum {\n" + ",\n".join(words) + "\n};\n")
    for message in known.by_id.values():
        lower = message.name.lower()
        lines.append(f"#define SWINGID_{message.name.upper()} {message.id}")
        lines.append(f"#define SWINGID_{message.name.upper()}_LENGTH {message.length}")
        fields = [
            f"    {TYPES[code][0]} {name}{f'[{count}]' if count else ''};" for name, count, code, _ in named(message)
        ]
        lines.append("typedef struct {\n" + "\n".join(fields) + f"\n}} swingid_{lower};")
        lines.append(f"void swingid_pack_{lower}(uint8_t *payload, const swingid_{lower} *frame);")
        lines.append(f"void swingid_unpack_{lower}(swingid_{lower} *frame, const uint8_t *payload);\n")
    lines.append("/* Length of the payload of a message of the host, -1 for any other identifier. */")
    lines.append("int swingid_length_from_host(uint16_t id);\n")
    lines.append("/* The 8 bytes of a number, least significant first. */")
    lines.append("void swingid_put_f64(uint8_t *bytes, double number);\n\n#endif\n")
    return "\n".join(lines)


def functions(message: Message) -> str:
    """C of `pack` and `unpack` of one message."""
    lower, put, get = message.name.lower(), [], []
    for name, count, code, place in named(message):
        short, size = TYPES[code][1:]
        if count:
            loop = f"    for (int i = 0; i < {count}; i++) "
            put.append(f"{loop}put_{short}(payload + {place} + {size} * i, frame->{name}[i]);")
            get.append(f"{loop}frame->{name}[i] = get_{short}(payload + {place} + {size} * i);")
        else:
            put.append(f"    put_{short}(payload + {place}, frame->{name});")
            get.append(f"    frame->{name} = get_{short}(payload + {place});")
    clear = f"    for (int i = 0; i < {message.length}; i++) payload[i] = 0;"
    return "\n".join(
        [
            f"void swingid_pack_{lower}(uint8_t *payload, const swingid_{lower} *frame) {{",
            clear,
            *put,
            f"}}\n\nvoid swingid_unpack_{lower}(swingid_{lower} *frame, const uint8_t *payload) {{",
            *get,
            "}\n",
        ]
    )


def source(known: Schema) -> str:
    """Text of frames.c."""
    lines = [NOTE + '#include "frames.h"', HELPERS]
    lines += [functions(message) for message in known.by_id.values()]
    lines.append("int swingid_length_from_host(uint16_t id) {\n    switch (id) {")
    for message in known.by_id.values():
        if message.from_host:
            upper = message.name.upper()
            lines.append(f"        case SWINGID_{upper}:\n            return SWINGID_{upper}_LENGTH;")
    lines.append("        default:\n            return -1;\n    }\n}\n")
    return "\n".join(lines)


def main() -> None:
    """Write both files."""
    known = schema()
    (CORE / "frames.h").write_text(header(known), encoding="ascii")
    (CORE / "frames.c").write_text(source(known), encoding="ascii")


if __name__ == "__main__":
    main()
