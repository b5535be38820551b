"""The rules of link and state table hold whatever happens, and the check of it is alive."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from tests.model.checker import SMALL, Model, Scope, plants

from generator.states import state_table

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return Model(tmp_path_factory.mktemp("model"))


@pytest.mark.parametrize("scope", SMALL, ids=lambda scope: scope.name)
def test_nothing_goes_wrong(model: Model, scope: Scope) -> None:
    result = model.check(scope)
    assert (result.wrong, result.trace) == ("", ())
    assert result.complete
    assert result.states > 1000


# Where the small scopes don't reach.
SCOPES = {scope.name: scope for scope in SMALL} | {
    "relaxed": Scope(name="relaxed", what="", kinds=("enable", "limp")),
    "epochs": Scope(name="epochs", what="", kinds=("segments", "bad_segments"), commands=3,
                    holding=True, eras=3),
    "stops": Scope(name="stops", what="", kinds=(), commands=1, stops=2, holding=True),
    "handshake": Scope(name="handshake", what="", commands=0, stops=1, handshake=True, eras=2),
    "hosts": Scope(name="hosts", what="", kinds=("disarm",), hosts=2, holding=True, eras=3),
    "reset": Scope(name="reset", what="", kinds=("disarm",), resets=1, hosts=2, holding=True,
                   eras=3),
}  # fmt: skip
# By what is planted: what must be found, and in which scope.
FOUND = {
    "OLD_COMMAND_AGAIN": ("TWICE_OR_OUT_OF_ORDER", "refusal"),
    "GAP_ACCEPTED": ("TWICE_OR_OUT_OF_ORDER", "refusal"),
    "EPOCH_IGNORED": ("OLD_EPOCH_QUEUED", "epochs"),
    "RESUME_OF_ANY_EPOCH": ("RESUMED_BLINDLY", "stop"),
    "STOP_KEEPS_QUEUE": ("STOP_IGNORED", "stop"),
    "STOP_NEEDS_SESSION": ("STOP_IGNORED", "handshake"),
    "STOP_UNLATCHED": ("STOP_IGNORED", "stop"),
    "PLAY_WHEN_STOPPED": ("MOVES_THOUGH_LATCHED", "stop"),
    "DEAD_END": ("DEAD_END", "stop"),
    "RESUME_SWITCHES_ON": ("MOVES_WITHOUT_ENABLE", "stop"),
    "CELL_MISSING": ("TABLE_SAYS_NEVER", "stop"),
    "LIMP_KEEPS_PULSES": ("INCONSISTENT", "relaxed"),
    "REFUSAL_OVERWRITTEN": ("RECORD_LOST", "refusal"),
    "RECORD_ONCE": ("NOT_DELIVERED", "refusal"),
    "SESSION_KEEPS_NUMBERS": ("WRONG_VERDICT", "hosts"),
    "RESET_KEEPS_SESSION": ("NOT_DELIVERED", "reset"),
    "RECEIPT_TRUSTED": ("WRONG_VERDICT", "refusal"),
    "TOLD_TWICE": ("RECORD_TWICE", "refusal"),
    "NEVER_SENT_AGAIN": ("NOT_DELIVERED", "refusal"),
    "SAME_STOP": ("STOP_IGNORED", "stops"),
    "STOP_TRUSTED": ("STOP_CONFIRMED_TOO_EARLY", "stop"),
}


@pytest.mark.parametrize("plant", [name.removeprefix("PLANT_") for name in plants()[1:]])
def test_a_planted_error_is_found(model: Model, plant: str) -> None:
    wrong, scope = FOUND[plant]
    assert model.check(SCOPES[scope], plant=f"PLANT_{plant}").wrong == wrong


def test_every_property_is_broken_by_some_error() -> None:
    text = (HERE / "world.h").read_text(encoding="utf-8")
    properties = re.findall(r"X\((\w+)\)", text[text.index("#define WRONGS") :])
    assert {wrong for wrong, _ in FOUND.values()} == set(properties) - {"ALL_RIGHT"}


def test_the_table_is_the_firmwares_byte_by_byte(tmp_path: Path) -> None:
    """The generator reads the header's text; here the compiler reads it."""
    lines = ['#include "board/state_table.h"', "namespace setae {"]
    table = state_table()
    for e, (event, row) in enumerate(table.cells.items()):
        for m, (mode, byte) in enumerate(zip(table.modes, row, strict=True)):
            cell = f"state_table::kCells[int(Event::{_camel(event)})][int(Mode::{_camel(mode)})]"
            lines.append(f'static_assert({cell} == {byte}, "");')
            lines.append(f'static_assert(int(Event::{_camel(event)}) == {e}, "");')
            lines.append(f'static_assert(int(Mode::{_camel(mode)}) == {m}, "");')
    lines += [
        f'static_assert(state_of(Mode::{_camel(mode)}) == protocol::State::{_camel(state)}, "");'
        for mode, state in table.states.items()
    ]
    source = tmp_path / "table.cpp"
    source.write_text("\n".join([*lines, "}"]))
    include = [f"-I{ROOT}/firmware/lib/{name}/src" for name in ("board", "protocol")]
    command = ["c++", "-std=c++14", "-fsyntax-only", *include, str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def _camel(name: str) -> str:
    return "k" + "".join(part.capitalize() for part in name.split("_"))
