"""Whatever comes over the wire, a device neither raises nor talks out of turn."""

from hypothesis import given, settings
from hypothesis import strategies as st

from sim_backend.nodes.bench import bench_nodes
from sim_backend.nodes.communication import CanopenNode
from tests.sim_backend.fake_plant import FakePlant

DATA = st.binary(max_size=8)
OBJECTS = sorted({(spec.index, spec.sub) for node in bench_nodes(FakePlant()) for spec in node.dictionary})


@st.composite
def sdo_requests(draw: st.DrawFn, node_id: int) -> tuple[int, bytes]:
    """Requests that hit real objects more often than noise would."""
    index, sub = draw(st.sampled_from(OBJECTS))
    command = draw(st.sampled_from([0x22, 0x23, 0x2B, 0x2F, 0x40, 0x21, 0x60, 0x70, 0x00, 0x10, 0x1F]))
    return 0x600 + node_id, bytes([command]) + index.to_bytes(2, "little") + bytes([sub]) + draw(
        st.binary(min_size=4, max_size=4)
    )


@st.composite
def frames(draw: st.DrawFn, node_id: int) -> tuple[int, bytes]:
    return draw(
        st.one_of(
            sdo_requests(node_id),
            st.tuples(st.integers(0, 0x7FF), DATA),
            st.tuples(st.sampled_from([0x000, 0x080, 0x200 + node_id, 0x300 + node_id, 0x77F]), DATA),
            st.tuples(st.just(0x000), st.sampled_from([b"\x01\x00", b"\x80\x00", b"\x81\x00", b"\x82\x00"])),
        )
    )


def powered(which: int) -> CanopenNode:
    node = bench_nodes(FakePlant())[which]
    node.tick(0.0)
    return node


@settings(max_examples=150, deadline=None)
@given(st.data(), st.integers(0, 3))
def test_random_frames_never_raise_and_every_answer_is_a_valid_frame(data: st.DataObject, which: int) -> None:
    node = powered(which)
    time = 0.0
    for can_id, payload in data.draw(st.lists(frames(node.node_id), max_size=25)):
        answers = list(node.on_frame(time, can_id, payload))
        time += 1e-3
        answers += node.tick(time)
        assert len(answers) <= 12
        assert all(0 <= a.can_id <= 0x7FF and len(a.data) <= 8 for a in answers)


@settings(max_examples=50, deadline=None)
@given(st.data(), st.integers(0, 3))
def test_a_stopped_device_answers_no_request_at_all(data: st.DataObject, which: int) -> None:
    node = powered(which)
    node.on_frame(0.0, 0x000, b"\x02\x00")
    for can_id, payload in data.draw(st.lists(st.tuples(st.integers(1, 0x7FF), DATA), max_size=20)):
        assert not node.on_frame(0.0, can_id, payload)
    assert not node.on_frame(0.0, 0x600 + node.node_id, bytes.fromhex("4000100000000000"))


@settings(max_examples=100, deadline=None)
@given(st.data(), st.integers(0, 3))
def test_each_sdo_request_of_8_bytes_gets_exactly_one_answer(data: st.DataObject, which: int) -> None:
    node = powered(which)
    can_id, request = data.draw(sdo_requests(node.node_id))
    answers = [a for a in node.on_frame(0.0, can_id, request) if a.can_id == 0x580 + node.node_id]
    assert len(answers) == 1
    assert len(answers[0].data) == 8
