from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "cliport_policy"
_DATA = ["configs/*.yaml", "mixtures/*.yaml", "data/*.yaml", "color_heads/*.safetensors", "shapes/*.safetensors"]

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={package_name: ["py.typed", "weights/*.safetensors", "weights/*.json", *_DATA]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="Language-conditioned pick and place networks, their training and the policy server.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "calibrate = cliport_policy.calibrate:main",
            "dataset = cliport_policy.dataset:main",
            "explain = cliport_policy.explain:main",
            "fit_color_words = cliport_policy.color_words:main",
            "fit_presence = cliport_policy.fit_presence:main",
            "fit_shapes = cliport_policy.fit_shapes:main",
            "learn = cliport_policy.learn:main",
            "lerobot = cliport_policy.lerobot:main",
            "offline = cliport_policy.offline:main",
            "reliability = cliport_policy.reliability:main",
            "server = cliport_policy.node:main",
            "train = cliport_policy.train:main",
        ]
    },
)
