"""The four devices of the simulated bench: motor drive, load drive, output encoder, torque transducer."""

from sim_backend.nodes.communication import CanopenNode, NodeOptions
from sim_backend.nodes.drive402 import drive_node
from sim_backend.nodes.drive402_objects import DriveConfig
from sim_backend.nodes.encoder406 import EncoderConfig, encoder_node
from sim_backend.nodes.torque404 import TorqueConfig, torque_node
from sim_backend.ports import PlantPort

MOTOR_DRIVE = DriveConfig()
"""Node 1: the motor of the device under test."""

LOAD_DRIVE = DriveConfig(
    node_id=2,
    axis="load",
    encoder_counts=1048576,
    rated_torque=20.0,
    torque_constant=2.0,
    max_torque=60.0,
    max_speed=12.0,
    deceleration=10.0,
    quick_stop_deceleration=50.0,
    standstill_speed=0.01,
)
"""Node 2: a direct drive at the output."""

OUTPUT_ENCODER = EncoderConfig()
"""Node 3."""

TORQUE_TRANSDUCER = TorqueConfig()
"""Node 4."""


def bench_nodes(
    plant: PlantPort,
    *,
    motor: DriveConfig = MOTOR_DRIVE,
    load: DriveConfig | None = LOAD_DRIVE,
    encoder: EncoderConfig = OUTPUT_ENCODER,
    torque: TorqueConfig = TORQUE_TRANSDUCER,
    options: NodeOptions | None = None,
) -> tuple[CanopenNode, ...]:
    """Give the devices of a bench on `plant`; without `load` there is no load drive."""
    drives = [drive_node(config, plant, options) for config in (motor, load) if config is not None]
    return (*drives, encoder_node(encoder, plant, options), torque_node(torque, plant, options))
