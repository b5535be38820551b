"""Builds the C++ targets, with and without sanitizers; packs and unpacks their corpora."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Sequence
from hashlib import sha1
from pathlib import Path
from typing import Final

HERE: Final = Path(__file__).resolve().parent
ROOT: Final = HERE.parents[1]
BUILD: Final = ROOT / "build" / "fuzz"
LIBRARIES: Final = ROOT / "firmware" / "lib"

TARGETS: Final = {
    "decoder": ("decoder.cpp",),
    "board": (
        "board.cpp", "script.cpp", "bench.cpp", "motion_watch.cpp", "state_watch.cpp",
        "contact_watch.cpp", "line_watch.cpp",
    ),
}  # fmt: skip
"""What the fuzzer can drive, and the sources beside the firmware's."""

MAX_BYTES: Final = {"decoder": 96, "board": 200}
"""Longest input: short ones are fast, and easier to understand once they have failed."""

SANITIZED: Final = (
    "clang++", "-O2", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all",
    "-fsanitize-trap=undefined",  # half as long again with words instead
)  # fmt: skip
COUNTED: Final = ("clang++", "-O1", "-g", "-fprofile-instr-generate", "-fcoverage-mapping")
FAST: Final = ("clang++", "-O2")
QUICK: Final = ("clang++", "-O1")
_COMMON: Final = ("-std=c++14", "-Wall", "-Wextra", "-Werror")


def firmware_sources() -> list[Path]:
    """Return the firmware's portable sources."""
    return sorted(path for path in LIBRARIES.glob("*/src/*/*.cpp") if path.parts[-2] != "hal_uno")


def includes(libraries: Path = LIBRARIES) -> list[str]:
    """Return the compiler's options that find the firmware's headers, and the tests'."""
    folders = sorted(path for path in libraries.glob("*/src") if path.parts[-2] != "hal_uno")
    return [f"-I{folder}" for folder in (*folders, HERE)]


def compile_object(compiler: Sequence[str], source: Path, out: Path) -> None:
    """Compile one source, with the firmware's headers."""
    _run([*compiler, *_COMMON, *includes(), "-c", str(source), "-o", str(out)])


def objects(
    compiler: Sequence[str], sources: Iterable[Path], *, tag: str, for_firmware: Sequence[str] = ()
) -> list[Path]:
    """Compile sources, those that have changed; a header counts for all.

    Parameters
    ----------
    tag
        Of the way they are compiled: objects of one tag are shared.
    for_firmware
        More options for the firmware's sources.
    """
    folder = BUILD / tag
    folder.mkdir(parents=True, exist_ok=True)
    newest = _newest_header()
    made = []
    for source in sources:
        out = folder / f"{source.relative_to(ROOT).as_posix().replace('/', '.')}.o"
        if not out.exists() or out.stat().st_mtime < max(newest, source.stat().st_mtime):
            more = for_firmware if source.is_relative_to(LIBRARIES) else ()
            compile_object([*compiler, *more], source, out)
        made.append(out)
    return made


def build(
    compiler: Sequence[str],
    name: str,
    sources: Iterable[Path],
    *,
    tag: str,
    for_firmware: Sequence[str] = (),
    for_program: Sequence[str] = (),
) -> Path:
    """Build a program from `sources` and the firmware; again only what has changed.

    Parameters
    ----------
    name, tag
        Of the program, and of the way it is built.
    for_firmware, for_program
        More options for the compiler, and for the linker.
    """
    parts = objects(compiler, [*firmware_sources(), *sources], tag=tag, for_firmware=for_firmware)
    program = BUILD / tag / name
    if not program.exists() or program.stat().st_mtime < max(o.stat().st_mtime for o in parts):
        link([*compiler, *for_program], parts, program)
    return program


def link(compiler: Sequence[str], parts: Iterable[Path], program: Path) -> None:
    """Link objects into a program."""
    _run([*compiler, *(str(part) for part in parts), "-o", str(program)])


def fuzzer(target: str) -> Path:
    """Build a target with libFuzzer and the sanitizers; only the firmware steers the fuzzer."""
    return build(
        SANITIZED, target, sources_of(target), tag="sanitized",
        for_firmware=["-fsanitize-coverage=inline-8bit-counters,pc-table"],
        for_program=["-fsanitize=fuzzer"],
    )  # fmt: skip


def sources_of(target: str) -> list[Path]:
    """Return a target's own sources."""
    return [HERE / name for name in TARGETS[target]]


def _newest_header() -> float:
    headers = [*LIBRARIES.glob("*/src/*/*.h"), *HERE.glob("*.h")]
    return max(path.stat().st_mtime for path in headers)


def _run(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")


# ------------------------------------------------------------------------------- corpora


def packed(target: str) -> Path:
    """Return the file that holds a target's corpus: an input a line, in hex."""
    return HERE / "corpus" / f"{target}.txt"


def read_corpus(target: str) -> list[bytes]:
    """Return the inputs of a target's corpus."""
    lines = packed(target).read_text().splitlines()
    return [bytes.fromhex(line.partition("#")[0]) for line in lines]


def write_corpus(target: str, inputs: Iterable[bytes]) -> None:
    """Replace a target's corpus, the short inputs first; those made by hand stay.

    By hand are those with a comment.
    """
    lines = [line for line in packed(target).read_text().splitlines() if "#" in line]
    by_hand = set(read_by_hand(lines))
    found = {item.hex() for item in inputs if item and item not in by_hand}
    lines += sorted(found, key=lambda text: (len(text), text))
    packed(target).write_text("".join(f"{line}\n" for line in lines))


def read_by_hand(lines: Iterable[str]) -> list[bytes]:
    """Return the inputs of lines with a comment."""
    return [bytes.fromhex(line.partition("#")[0]) for line in lines if "#" in line]


def unpack(target: str, folder: Path) -> Path:
    """Write a target's corpus as files, as a fuzzer reads it; return their folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for item in read_corpus(target):
        (folder / sha1(item, usedforsecurity=False).hexdigest()).write_bytes(item)
    return folder
