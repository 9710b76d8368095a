"""Describes a machine. Processors of machines with equal descriptions write the same bytes.

Cycles and Embree use other kernels on processors without AVX2. The denoiser uses others on
processors with AVX-512. Embree builds on approximate reciprocals, which differ between makers of
processors. C libraries round sines and powers differently. All of this changes the last digits of
results. Numpy, numba and OpenBLAS would use other kernels on processors with AVX-512, too, but
`lightfield.core.isolation` makes them use AVX2.
"""

import itertools
import platform
from collections.abc import Mapping
from pathlib import Path

_CPUINFO = Path("/proc/cpuinfo")
# The instructions that Cycles needs for its AVX2 kernel.
_AVX2 = {"avx", "f16c", "avx2", "fma", "bmi1", "bmi2"}
# The further instructions that the denoiser needs for its AVX-512 kernel.
_AVX512 = {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"}


def describe(denoise: bool, cpuinfo: Path = _CPUINFO) -> str:
    """Return the maker and instructions of this machine's processor, and its C library.

    AVX-512 matters only for views with ``denoise``. ``cpuinfo`` is where Linux describes
    processors. If it names no maker, the machine's architecture stands for it.
    """
    facts = _first_processor(cpuinfo)
    processor = platform.machine()
    if "vendor_id" in facts:
        instructions = _instructions(facts)
        kernels = "AVX2" if instructions >= _AVX2 else "SSE4.2"
        if denoise and instructions >= _AVX2 | _AVX512:
            kernels = "AVX-512"
        processor = f"{facts['vendor_id']} {kernels}"
    library = " ".join(filter(None, platform.libc_ver()))
    return f"{processor}, {library or platform.system()}"


def has_avx2(cpuinfo: Path = _CPUINFO) -> bool:
    """Return whether this machine's processor has AVX2, and what Cycles needs beside it."""
    return _instructions(_first_processor(cpuinfo)) >= _AVX2


def _instructions(facts: Mapping[str, str]) -> set[str]:
    return set(facts.get("flags", "").split())


def _first_processor(cpuinfo: Path) -> dict[str, str]:
    """Return the keys and values of the first processor in /proc/cpuinfo."""
    if not cpuinfo.exists():
        return {}
    with cpuinfo.open(encoding="utf-8") as lines:
        pairs = [line.partition(":") for line in itertools.takewhile(str.strip, lines)]
    return {name.strip(): value.strip() for name, _, value in pairs}
