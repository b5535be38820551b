"""The host's targets, driven by hypothesis."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from tests.fuzz import host

from setae.config.keys import keys
from setae.config.sections import SECTIONS

quick = settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])


@quick
@given(st.binary(max_size=60))
def test_the_engine_loses_nothing_on_any_line(data: bytes) -> None:
    host.engine(data)


values: Any = st.one_of(
    st.integers(),
    st.floats(),
    st.booleans(),
    st.text(max_size=5),
    st.lists(st.one_of(st.integers(), st.floats(), st.text(max_size=2)), max_size=5),
)


def as_toml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(as_toml, value))}]"
    return str(value) if isinstance(value, float) else json.dumps(value)


@st.composite
def documents(draw: st.DrawFn) -> str:
    """Draw real sections and keys, with values of any kind."""
    lines = []
    for name in draw(st.lists(st.sampled_from([*SECTIONS, "simulator"]), unique=True, max_size=4)):
        known = [*keys(SECTIONS[name])] if name in SECTIONS else ["servo.gain", "x"]
        lines.append(f"[{name}]")
        for key in draw(st.lists(st.sampled_from(known), unique=True, max_size=4)):
            lines.append(f"{key} = {as_toml(draw(values))}")
    return "\n".join(lines)


@quick
@given(st.one_of(st.text(max_size=60), documents()))
def test_any_text_is_a_configuration_or_refused_with_a_reason(text: str) -> None:
    host.config(text.encode("utf-8", errors="replace"))


anything = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-(2**70), 2**70), st.floats(), st.text()),
    lambda inner: st.one_of(st.lists(inner), st.dictionaries(st.text(), inner)),
    max_leaves=6,
)


@quick
@example(b"\0")
@given(
    st.one_of(
        st.binary(max_size=200),
        st.builds(lambda how, what: bytes([3 + 4 * how]) + json.dumps(what).encode(),
                  st.integers(0, 15), anything),
        st.builds(
            lambda how, time, rest: bytes([3 + 4 * how])
            + json.dumps(rest | {"time_us": time}).encode(),
            st.integers(0, 15), anything, st.dictionaries(st.text(), anything),
        ),
    )
)  # fmt: skip
def test_any_file_is_a_log_as_far_as_it_goes(data: bytes) -> None:
    host.log(data)
