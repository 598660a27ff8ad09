"""Robots that several tests use."""

from __future__ import annotations

import pytest

import stickslip as ss

BALL = """
<robot name="ball">
  <link name="ball">
    <inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
</robot>
"""

# A floating base with one hinge, so that joints, control and frames have something to act on.
FLAIL = """
<robot name="flail">
  <link name="handle">
    <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.4 0.1 0.1"/></geometry></collision>
  </link>
  <link name="swipple">
    <inertial>
      <origin xyz="0.1 0 0"/><mass value="0.5"/><inertia ixx="0.001" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <link name="tip"/>
  <joint name="hinge" type="revolute">
    <parent link="handle"/><child link="swipple"/><origin xyz="0.2 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="10" velocity="10"/>
  </joint>
  <joint name="tip" type="fixed"><parent link="swipple"/><child link="tip"/><origin xyz="0.2 0 0"/></joint>
</robot>
"""


@pytest.fixture(scope="session")
def ball() -> ss.Model:
    """A sphere of 2 kg and 0.1 m, free."""
    return ss.parse_urdf(BALL)


@pytest.fixture(scope="session")
def flail() -> ss.Model:
    """A box with a stick on a hinge, free."""
    return ss.parse_urdf(FLAIL)
