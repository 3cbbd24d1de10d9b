from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "panda_driver"

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
    description="Driver of a Franka arm and hand by libfranka, and a test of any arm behind the same actions.",
    license="Apache-2.0",
    tests_require=["pytest"],
    entry_points={
        "console_scripts": [
            "driver = panda_driver.node:main",
            "conformance = panda_driver.conformance.main:main",
            "record_run = panda_driver.node_record_run:main",
        ]
    },
)
