"""Describes what of a machine changes bytes. Machines with one description make the same files.

Cycles and Embree take other kernels on processors without AVX2, and the denoiser on those with
AVX-512. Embree builds on approximate reciprocals, which each maker of processors has in its own
way. C libraries round sines and powers differently. All of it shows in last digits.
"""

import platform
from pathlib import Path

# All that Cycles asks for where it takes its kernel for AVX2, and the denoiser beyond that.
_AVX2 = {"avx", "f16c", "avx2", "fma", "bmi1", "bmi2"}
_AVX512 = {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"}


def describe(denoise: bool, cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """Return the maker and instructions of this machine's processor, and its C library.

    They are those that matter for views that are rendered with or without ``denoise``. ``cpuinfo``
    is where Linux describes processors; of one without a maker there it is the name of its kind.
    """
    facts = _first_processor(cpuinfo)
    processor = platform.machine()
    if "vendor_id" in facts:
        flags = set(facts.get("flags", "").split())
        instructions = "AVX2" if flags >= _AVX2 else "SSE4.2"
        if denoise and flags >= _AVX2 | _AVX512:
            instructions = "AVX-512"
        processor = f"{facts['vendor_id']} {instructions}"
    library = " ".join(filter(None, platform.libc_ver()))
    return f"{processor}, {library or platform.system()}"


def _first_processor(cpuinfo: Path) -> dict[str, str]:
    """Return what /proc/cpuinfo says of the first processor, by its keys."""
    if not cpuinfo.exists():
        return {}
    first, _, _ = cpuinfo.read_text().partition("\n\n")
    pairs = (line.partition(":") for line in first.splitlines())
    return {name.strip(): value.strip() for name, _, value in pairs}
