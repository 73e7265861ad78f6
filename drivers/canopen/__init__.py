"""CANopen over python-can: drives (CiA 402), encoders (CiA 406), torque transducers (CiA 404).

    bus.py       one owner of the transport, one exchange per control cycle
    link.py      frames in and out, routed by identifier; waiting pumps the bus
    sdo.py       object access: matched replies, no retry, typed values
    pdo.py       layout of process data, and the remapping procedure
    cia402.py    the power state machine as a table, without I/O
    node.py      what all devices share: identity, heartbeat, emergency messages, changes and their restoration
    drive.py, encoder.py, torque.py   the three devices
    profiles/    units and behaviour that differ from vendor to vendor, as data

The library `canopen` serves for SDO transfers only; its drive profile, PDO maps, threads and cyclic senders are unfit
for a bench that must know what a drive really did.
"""
