"""Every message survives encoding; nothing else is taken for one."""

import math
from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.training import messages
from app.training.messages import MESSAGE_TYPES, StepReported, TrainJob, decode, encode

_VALUES = {
    "int": st.integers(-(2**53), 2**53),
    "float": st.floats(allow_nan=False),
    "str": st.text(),
    "bool": st.booleans(),
    "int | None": st.none() | st.integers(-255, 255),
    "float | None": st.none() | st.floats(allow_nan=False),
    "tuple[int, int] | None": st.none() | st.tuples(st.integers(0, 100), st.integers(0, 100)),
    "tuple[int, ...]": st.lists(st.integers(0, 100), max_size=5).map(tuple),
    "dict[str, SettingValue]": st.dictionaries(
        st.text(), st.integers() | st.text() | st.floats(allow_nan=False), max_size=4
    ),
}


@pytest.mark.parametrize("kind", MESSAGE_TYPES.values(), ids=MESSAGE_TYPES.keys())
@given(data=st.data())
def test_decoding_inverts_encoding(kind, data):
    values = {item.name: data.draw(_VALUES[str(item.type)], label=item.name) for item in fields(kind)}
    message = kind(**values)
    assert decode(encode(message)) == message


def test_numbers_that_are_not_finite_travel_too():
    back = decode(encode(StepReported(1, 2, math.nan, math.inf, 3, "joint", 0.0, 1.0)))
    assert isinstance(back, StepReported)
    assert math.isnan(back.loss)
    assert back.train_psnr == math.inf


@pytest.mark.parametrize(
    "data", [b"", b"{}", b'["Nobody", {}]', b'["Pause", {"x": 1}]', b'["StepReported", {"step": 1}]', b"\xff\x00"]
)
def test_what_is_no_message_is_refused(data):
    with pytest.raises(ValueError, match="not a message"):
        decode(data)


def test_the_table_holds_every_message_class_of_the_module():
    defined = {
        name
        for name, thing in vars(messages).items()
        if isinstance(thing, type) and thing.__module__ == messages.__name__
    }
    assert defined == set(MESSAGE_TYPES)
    assert TrainJob.__name__ in MESSAGE_TYPES
