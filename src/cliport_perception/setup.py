from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "cliport_perception"

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
    description="Camera model, point clouds and the top-down heightmap that CLIPort's policy observes.",
    license="Apache-2.0",
    tests_require=["pytest"],
    entry_points={
        "console_scripts": [
            "perception = cliport_perception.node:main",
            "calibrate = cliport_perception.calibration.cli:main",
            "camera_pose = cliport_perception.calibration.node_camera_pose:main",
        ]
    },
)
