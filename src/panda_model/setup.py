from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "panda_model"

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={package_name: ["py.typed", "presets/*.yaml", "presets/hands/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="The arm and the hand, stated once: names, limits, frames, URDF, geometry and controllers.",
    license="Apache-2.0",
    tests_require=["pytest"],
)
