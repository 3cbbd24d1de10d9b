from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "demo_tool"

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={package_name: ["py.typed", "static/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="The page on which a person demonstrates, and the command that edits what was recorded.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "app = demo_tool.app:main",
            "episodes = demo_tool.episodes_cli:main",
        ]
    },
)
