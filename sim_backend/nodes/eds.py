"""The EDS file (CiA 306) of a simulated device, written from the table of objects that it serves."""

import struct
from collections.abc import Iterable, Iterator
from itertools import groupby

from sim_backend.nodes.communication import CanopenNode
from sim_backend.nodes.object_dictionary import ObjectSpec

_VAR, _RECORD = 0x7, 0x9
_MANDATORY = (0x1000, 0x1001, 0x1018)


def eds_text(node: CanopenNode) -> str:
    """Give the file for the device as it is shipped; a master finds every object in it, with type and default."""
    specs = sorted(node.dictionary, key=lambda spec: (spec.index, spec.sub))
    return "\n".join(_lines(node, specs)) + "\n"


def _lines(node: CanopenNode, specs: list[ObjectSpec]) -> Iterator[str]:
    kind = node.device.device_type
    identity = {spec.sub: int(spec.default) for spec in specs if spec.index == 0x1018}
    yield from ("[FileInfo]", f"FileName={kind.name.replace(' ', '_')}.eds", "FileVersion=1", "EDSVersion=4.0", "")
    yield from ("[DeviceInfo]", "VendorName=simulated", f"VendorNumber=0x{identity.get(1, 0):08X}")
    yield from (f"ProductName={kind.name}", f"ProductNumber=0x{identity.get(2, 0):08X}")
    yield from (f"RevisionNumber=0x{identity.get(3, 0):08X}", "BaudRate_1000=1", "Granularity=8", "")
    indices = sorted({spec.index for spec in specs})
    rest = [index for index in indices if index not in _MANDATORY]
    groups = {
        "MandatoryObjects": [index for index in indices if index in _MANDATORY],
        "OptionalObjects": [index for index in rest if not 0x2000 <= index < 0x6000],
        "ManufacturerObjects": [index for index in rest if 0x2000 <= index < 0x6000],
    }
    for title, members in groups.items():
        yield from (f"[{title}]", f"SupportedObjects={len(members)}")
        yield from (f"{number}=0x{index:04X}" for number, index in enumerate(members, start=1))
        yield ""
    for index, entries in groupby(specs, key=lambda spec: spec.index):
        yield from _entry(index, list(entries))


def _entry(index: int, entries: list[ObjectSpec]) -> Iterable[str]:
    if len(entries) == 1 and entries[0].sub == 0:
        return [f"[{index:04X}]", f"ObjectType=0x{_VAR:X}", *_variable(entries[0])]
    title = entries[0].name.partition(":")[0]
    lines = [f"[{index:04X}]", f"ParameterName={title}", f"ObjectType=0x{_RECORD:X}", f"SubNumber={len(entries)}", ""]
    for spec in entries:
        lines += [f"[{index:04X}sub{spec.sub:X}]", f"ObjectType=0x{_VAR:X}", *_variable(spec)]
    return lines


def _variable(spec: ObjectSpec) -> list[str]:
    lines = [f"ParameterName={spec.name}", f"DataType=0x{spec.type.code:04X}", f"AccessType={spec.access}"]
    if isinstance(spec.default, bytes):
        lines.append(f"DefaultValue={spec.default.decode('ascii')}")
    elif isinstance(spec.default, int):
        lines.append(f"DefaultValue={spec.default}")
    else:
        (bits,) = struct.unpack("<I", struct.pack("<f", spec.default))
        lines.append(f"DefaultValue=0x{bits:08X}")
    for key, bound in (("LowLimit", spec.low), ("HighLimit", spec.high)):
        if bound is not None:
            lines.append(f"{key}={bound:.0f}")
    return [*lines, f"PDOMapping={int(spec.mappable)}", ""]
