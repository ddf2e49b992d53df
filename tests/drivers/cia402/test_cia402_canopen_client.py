"""The simulated axis under canopen's own CiA 402 client: a host that this project did not write."""

from __future__ import annotations

import time

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402
from rtcomp_drivers.cia402_objects import EDS
from waiting import wait


@pytest.fixture
def node(drive):
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.05
    network.connect(interface="virtual", channel=drive.channel)
    node = BaseNode402(5, str(EDS))
    network.add_node(node)
    yield node
    if network.sync._task is not None:
        network.sync.stop()
    network.disconnect()


def prepare(node):
    node.nmt.state = "PRE-OPERATIONAL"
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    node.rpdo[1].start(0.005)  # synchronous PDOs are sent all the time, or canopen sends them never
    node.network.sync.start(0.01)


def test_it_is_enabled_moved_and_disabled(drive, node):
    node.sdo[0x1017].raw = 50
    node.nmt.wait_for_heartbeat(5.0)
    prepare(node)
    assert node.is_op_mode_supported("CYCLIC SYNCHRONOUS TORQUE")
    assert not node.is_op_mode_supported("PROFILED POSITION")
    node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
    assert node.op_mode == "CYCLIC SYNCHRONOUS TORQUE"
    node.state = "OPERATION ENABLED"
    assert node.state == "OPERATION ENABLED"
    began = node.sdo[0x6064].raw
    node.rpdo[1][0x6071].raw = 2000
    wait(lambda: node.tpdo_values[0x6064] > began + 1000)
    assert drive.axis.output == pytest.approx(2.0)
    node.state = "SWITCH ON DISABLED"
    assert node.state == "SWITCH ON DISABLED"
    assert drive.axis.output == 0.0
    node.nmt.wait_for_heartbeat(5.0)
    assert node.nmt.state == "OPERATIONAL"


def test_quick_stop_and_back(drive, node):
    prepare(node)
    node.op_mode = "PROFILED TORQUE"
    node.state = "OPERATION ENABLED"
    node.state = "QUICK STOP ACTIVE"
    assert node.state == "QUICK STOP ACTIVE"
    assert drive.axis.output == 0.0
    node.state = "OPERATION ENABLED"
    assert node.state == "OPERATION ENABLED"


def test_its_emergency_and_its_fault(drive, node):
    prepare(node)
    node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
    node.state = "OPERATION ENABLED"
    drive.fail(0x4310)
    wait(lambda: node.emcy.active)
    assert node.emcy.active[0].code == 0x4310
    wait(node.is_faulted)
    assert node.sdo[0x603F].raw == 0x4310
    node.rpdo[1][0x6071].raw = 0
    node.reset_from_fault()
    assert node.state == "OPERATION ENABLED"
    assert not node.emcy.active


def test_a_heartbeat_that_ends_is_an_emergency(drive, node):
    prepare(node)
    node.sdo[0x1016][1].raw = 127 << 16 | 300
    node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
    beat = node.network.send_periodic(0x77F, b"\x05", 0.05)
    node.state = "OPERATION ENABLED"
    node.rpdo[1][0x6071].raw = 500
    wait(lambda: drive.axis.output > 0.0)
    time.sleep(0.6)
    assert drive.axis.output > 0.0
    beat.stop()
    wait(lambda: node.emcy.active)
    assert node.emcy.active[0].code == 0x8130
    assert drive.axis.output == 0.0


def test_objects_of_every_kind(node):
    assert node.sdo[0x1008].raw == "rtcomp simulated CiA 402 axis"  # segmented
    assert node.sdo[0x1018][1].raw == 0
    with pytest.raises(canopen.SdoAbortedError) as caught:
        node.sdo.upload(0x2222, 0)
    assert caught.value.code == 0x06020000
    with pytest.raises(canopen.SdoAbortedError) as caught:
        node.sdo.download(0x1008, 0, b"another name")
    assert caught.value.code == 0x06070010
    node.tpdo[1].read()
    assert [v.index for v in node.tpdo[1].map] == [0x6041, 0x6064]


def test_canopen_maps_its_pdos(node):
    node.nmt.state = "PRE-OPERATIONAL"
    node.tpdo.read()
    node.rpdo.read()
    tpdo = node.tpdo[1]
    tpdo.clear()
    for index in (0x6064, 0x6077, 0x6041):
        tpdo.add_variable(index)
    tpdo.save()
    node.nmt.state = "OPERATIONAL"
    node.network.sync.start(0.01)
    assert tpdo.wait_for_reception(5.0) is not None
    assert len(tpdo.data) == 8
    assert tpdo[0x6041].raw & 0x4F == 0x40
