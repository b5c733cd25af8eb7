"""A figure inside the page: as small as it can be, with the same picture."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import numpy as np

from rigsight.plot.drawing import new_figure
from rigsight.report.figures import page_figure


def drawn(key: str = "figure-a") -> str:
    figure = new_figure(4.0, 3.0)
    ax = figure.subplots()
    ax.plot(np.linspace(0.0, 1.0, 50), np.linspace(0.0, 1.0, 50) ** 2, color="#0072b2")
    ax.bar([0.5], [0.3], hatch="//")
    ax.set_xlabel("a < b & c")
    return str(page_figure(figure, key, "what it shows", "caption").image)


def test_it_is_sound_and_its_references_lead_somewhere() -> None:
    text = drawn()
    ET.fromstring(text)
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids)) > 0
    assert all(name.startswith("figure-a-") for name in ids)
    referred = re.findall(r'url\(#([^)]+)\)|href="#([^"]+)"', text)
    assert {one or other for one, other in referred} == set(ids)


def test_a_line_keeps_all_its_points_to_a_hundredth() -> None:
    (path,) = [
        d for d, style in re.findall(r'<path d="([^"]+)"[^>]*?style="([^"]*)"', drawn()) if "#0072b2" in style and "none" in style
    ]  # fmt: skip
    assert re.fullmatch(r"M[\d.]+ [\d.]+(L[\d.]+ [\d.]+)*", path)
    numbers = np.array(re.findall(r"[\d.]+", path), dtype=float).reshape(-1, 2)
    across = (numbers[:, 0] - numbers[0, 0]) / np.ptp(numbers[:, 0])
    up = (numbers[0, 1] - numbers[:, 1]) / np.ptp(numbers[:, 1])
    assert numbers.shape[0] > 30
    assert np.max(np.abs(up - across**2)) < 2e-4
