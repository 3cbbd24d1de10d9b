from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "panda_executor"

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={package_name: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="Grasp, motion planning and execution of pick and place for a Panda.",
    license="Apache-2.0",
    tests_require=["pytest"],
    entry_points={
        "console_scripts": [
            "executor = panda_executor.main:main",
            "guard = panda_executor.node_guard:main",
            "hand_frame = panda_executor.node_hand_frame:main",
        ]
    },
)
