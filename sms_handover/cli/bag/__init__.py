"""``sms-handover bag``: inspect, check, recover, export, play and record recordings."""

COMMANDS = {
    "info": "show the contents of a bag: topics, times, controller, versions, loss ledger",
    "check": "check whether a bag is complete, and what is missing",
    "recover": "recover a truncated or damaged bag",
    "export": "export tables as CSV, Parquet or MATLAB files",
    "robot": "write the robot of a run as URDF, SRDF (MoveIt) and MJCF (MuJoCo)",
    "play": "publish the messages of any MCAP bag, with keys to control it",
    "record": "record topics of any graph to an MCAP bag",
}
DESCRIPTION = (
    "Work with recordings: a run folder, a bag folder or an .mcap file, of any ROS 2 recorder that writes\n"
    "MCAP. See docs/bags.md and docs/playback.md."
)
