"""ur_rtde, a client that knows nothing of this project, against the virtual controller. See docs/virtual-ur.md."""

import time

import rtde_control
import rtde_io
import rtde_receive
from dashboard_client import DashboardClient

ROBOT = "127.0.0.1"


def close(a, b, tolerance):
    return len(a) == len(b) and all(abs(x - y) <= tolerance for x, y in zip(a, b))


dashboard = DashboardClient(ROBOT)
dashboard.connect()
assert dashboard.robotmode() == "Robotmode: RUNNING"
assert dashboard.safetystatus() == "Safetystatus: NORMAL"
assert dashboard.isInRemoteControl()

receive = rtde_receive.RTDEReceiveInterface(ROBOT)
start = receive.getTimestamp()
time.sleep(1.0)
assert 0.8 < receive.getTimestamp() - start < 1.1

# Uploads a control program of 42 kB and waits until it reports.
control = rtde_control.RTDEControlInterface(ROBOT)
assert control.isProgramRunning()

goal = receive.getActualQ()
goal[0] += 0.3
assert control.moveJ(goal, 1.0, 1.0)
assert close(receive.getActualQ(), goal, 1e-3)

pose = receive.getActualTCPPose()
pose[2] += 0.05
assert control.moveL(pose, 0.25, 0.5)
assert close(receive.getActualTCPPose(), pose, 1e-4)

goal = receive.getActualQ()
for _ in range(500):
    begin = control.initPeriod()
    goal[5] += 0.0005
    control.servoJ(goal, 0, 0, 0.002, 0.1, 300)
    control.waitPeriod(begin)
# 0.25 rad/s behind a lookahead of 0.1 s.
assert close(receive.getActualQ(), goal, 0.04)
assert control.servoStop()

assert control.speedJ([0, 0, 0, 0, 0, 0.2], 0.5, 0)
time.sleep(1.0)
assert abs(receive.getActualQd()[5] - 0.2) < 1e-3
assert control.speedStop()

assert control.zeroFtSensor()
assert control.setTcp([0, 0, 0.1, 0, 0, 0])
assert control.setPayload(0.5, [0, 0, 0.05])
joints = control.getInverseKinematics(receive.getActualTCPPose(), receive.getActualQ())
assert close(joints, receive.getActualQ(), 1e-4)

io = rtde_io.RTDEIOInterface(ROBOT)
assert io.setSpeedSlider(0.5)
time.sleep(0.8)
assert abs(receive.getSpeedScaling() - 0.5) < 1e-6
assert io.setStandardDigitalOut(3, True)
time.sleep(0.1)
assert receive.getDigitalOutState(3)

control.stopScript()
time.sleep(0.1)
dashboard.powerOff()
time.sleep(0.5)
assert dashboard.robotmode() == "Robotmode: POWER_OFF"
dashboard.brakeRelease()
time.sleep(3.5)
assert dashboard.robotmode() == "Robotmode: RUNNING"
print("all of it works")
