"""Protobuf messages of the log, built at run time from the signal table, so that no code generator is needed.

Every field of `rig.Sample` has explicit presence: a signal that was not measured in a cycle is absent, not zero.
Numbers have a fixed size on the wire (double, sfixed64, fixed32), so that all samples with the same signals have
the same layout and can be read as one array. Encoding: protobuf language guide, "Encoding", sections "Non-varint
numbers" and "Proto3 optional".
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from google.protobuf.message import Message

from drivers.signals import AUXILIARY_PREFIX, INTEGER_SIGNALS, SIGNALS

SAMPLE_TOPIC = "/rig/sample"
EVENT_TOPIC = "/rig/event"
SAMPLE_TYPE = "rig.Sample"
EVENT_TYPE = "rig.Event"
EMERGENCY_TYPE = "rig.Emergency"

FIELD_NUMBERS: Mapping[str, int] = MappingProxyType(
    {
        "motor_position": 1,
        "motor_velocity": 2,
        "motor_torque": 3,
        "motor_torque_command": 4,
        "motor_current": 5,
        "output_position": 6,
        "output_velocity": 7,
        "output_torque": 8,
        "load_torque": 9,
        "load_position": 10,
        "cycle": 11,
        "late": 12,
        "status_word": 13,
        "temperature": 14,
        "bus_voltage": 15,
        "motor_position_command": 16,
        "motor_velocity_command": 17,
        "load_torque_command": 18,
        "motor_temperature": 19,
        "supply_voltage": 20,
        "load_status_word": 21,
    }
)
"""Field number of each signal. Never renumber; a new signal takes the next free number below 100."""

FIRST_AUXILIARY_NUMBER = 100

_SIGNED_64 = frozenset({"cycle"})
_EVENT_FIELDS = (
    ("time_s", FieldDescriptorProto.TYPE_DOUBLE),
    ("kind", FieldDescriptorProto.TYPE_STRING),
    ("text", FieldDescriptorProto.TYPE_STRING),
)
_EMERGENCY_FIELDS = (
    ("time_s", FieldDescriptorProto.TYPE_DOUBLE),
    ("text", FieldDescriptorProto.TYPE_STRING),
    ("code", FieldDescriptorProto.TYPE_UINT32),
    ("register", FieldDescriptorProto.TYPE_UINT32),
    ("data", FieldDescriptorProto.TYPE_BYTES),
)


@dataclass(frozen=True, slots=True)
class LogField:
    """One field of `rig.Sample`: its name in the log, the signal it carries, number, `struct` code and unit."""

    name: str
    signal: str
    number: int
    code: str
    unit: str
    auxiliary: bool


def sample_fields(auxiliary: Mapping[str, str]) -> tuple[LogField, ...]:
    """Give the fields of `rig.Sample` in order of their number; `auxiliary` maps further names to their units."""
    table = [
        LogField(signal.field, signal.name, FIELD_NUMBERS[signal.name], _code(signal.name), signal.unit, False)
        for signal in SIGNALS
    ]
    further = [
        LogField(AUXILIARY_PREFIX + name, name, FIRST_AUXILIARY_NUMBER + index, "d", unit, True)
        for index, (name, unit) in enumerate(auxiliary.items())
    ]
    return tuple(sorted(table, key=lambda item: item.number) + further)


def sample_schema(fields: Iterable[LogField]) -> bytes:
    """Give the serialised FileDescriptorSet that describes `rig.Sample`."""
    types = {
        "d": FieldDescriptorProto.TYPE_DOUBLE,
        "q": FieldDescriptorProto.TYPE_SFIXED64,
        "I": FieldDescriptorProto.TYPE_FIXED32,
    }
    return _schema(SAMPLE_TYPE, [(item.name, types[item.code], item.number) for item in fields])


def event_schema() -> bytes:
    """Give the serialised FileDescriptorSet that describes `rig.Event`."""
    return _schema(EVENT_TYPE, [(name, kind, i + 1) for i, (name, kind) in enumerate(_EVENT_FIELDS)])


def emergency_schema() -> bytes:
    """Give the serialised FileDescriptorSet that describes `rig.Emergency`."""
    return _schema(EMERGENCY_TYPE, [(name, kind, i + 1) for i, (name, kind) in enumerate(_EMERGENCY_FIELDS)])


def emergency_topic(device: str) -> str:
    """Give the topic of a device's emergency messages."""
    return f"/drive/{device}/emcy"


def message_class(schema: bytes, type_name: str) -> type[Message]:
    """Give the message class of `type_name` for a serialised FileDescriptorSet.

    Raises KeyError, TypeError or google.protobuf's DecodeError if the schema is broken or lacks the type.
    """
    pool = descriptor_pool.DescriptorPool()
    for file in FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(type_name))


def _code(signal: str) -> str:
    if signal not in INTEGER_SIGNALS:
        return "d"
    return "q" if signal in _SIGNED_64 else "I"


def _schema(full_name: str, fields: Sequence[tuple[str, FieldDescriptorProto.Type.ValueType, int]]) -> bytes:
    package, _, name = full_name.rpartition(".")
    file = descriptor_pb2.FileDescriptorProto(name=f"{package}/{name.lower()}.proto", package=package, syntax="proto3")
    message = file.message_type.add(name=name)
    for index, (field, kind, number) in enumerate(fields):
        message.field.add(
            name=field,
            number=number,
            type=kind,
            label=FieldDescriptorProto.LABEL_OPTIONAL,
            proto3_optional=True,
            oneof_index=index,
        )
        message.oneof_decl.add(name=f"_{field}")
    return FileDescriptorSet(file=[file]).SerializeToString()
