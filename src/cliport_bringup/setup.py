from glob import glob
from xml.etree import ElementTree

from setuptools import setup

package_name = "cliport_bringup"

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=[],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
        ("share/" + package_name + "/launch", sorted(glob("launch/*.yaml"))),
        ("share/" + package_name + "/config", sorted(glob("config/*.yaml"))),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="Launch files and parameters of the CLIPort graph.",
    license="Apache-2.0",
)
