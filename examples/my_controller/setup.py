"""Install my_controller as a ROS package (colcon) or as a wheel (pip)."""

from setuptools import find_packages, setup

PACKAGE = "my_controller"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="A control law of one's own for sms_handover",
    maintainer="sms_handover maintainers",
    maintainer_email="maintainers@sms-handover.example",
    license="BSD-3-Clause",
    packages=find_packages(include=[PACKAGE]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["sms_handover[ros]"],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "task_space_pd = my_controller.node:main",
            "task_space_pd_bare = my_controller.bare_node:main",
        ],
        "sms_handover.control_laws": ["task_space_pd = my_controller.law:LAW"],
    },
)
