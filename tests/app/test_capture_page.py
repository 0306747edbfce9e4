"""Motion capture in a browser: a trial is opened, fitted, and its moments have bands."""

from typing import Any

from .conftest import opened, until
from .on_page import chosen, in_sight
from .test_capture import arm, markers, plates


def given(page: Any, name: str, text: str) -> None:
    """A file that is chosen in the tab."""
    page.locator("[data-view=capture] input[type=file]").set_input_files(
        {"name": name, "mimeType": "text/csv", "buffer": text.encode()}
    )


def test_a_trial_is_opened_fitted_and_its_moments_are_shown_with_bands(
    page: Any, served: Any, compiled: Any
):
    opened(page, served, arm())
    page.evaluate("pgraph.front('Capture')")
    until(lambda: in_sight(served, "capture"), "the tab in sight")
    host = page.locator("[data-view=capture]")
    assert host.locator("button.fit-pose").is_hidden()
    given(page, "swing.csv", markers(off=0.003, hand="RHAN"))
    host.locator("button.fit-pose").wait_for()
    assert "RHAN" in host.locator(".spare").inner_text()
    chosen(page.get_by_label("marker of hand", exact=True), "RHAN")
    until(lambda: served.store.state.take.label("hand") == "RHAN", "the marker of the hand")
    given(page, "plates.csv", plates())
    until(lambda: len(served.store.state.take.files) == 2, "the plates")
    host.locator("button.fit-pose").click()
    host.locator(".fit-title", has_text="worst is hand").wait_for()
    assert page.locator("output.time").inner_text().endswith("0.390 s")
    host.locator("button.compute-moments").click()
    host.locator(".capture-curves svg .band").wait_for(state="attached")
    with page.expect_download() as download:
        host.locator("button.export-moments").click()
    assert download.value.suggested_filename == "swing_moments.csv"
    host.locator("button.close-trial").click()
    until(lambda: served.store.state.take is None, "no trial")
    host.locator("button.fit-pose").wait_for(state="hidden")


def test_a_dropped_trial_opens_its_tab(page: Any, served: Any):
    opened(page, served, arm())
    page.evaluate(
        """(text) => {
          const data = new DataTransfer();
          data.items.add(new File([text], "swing.csv"));
          window.dispatchEvent(new DragEvent("drop", { dataTransfer: data, cancelable: true }));
        }""",
        markers(),
    )
    until(lambda: served.store.state.take is not None, "the trial")
    assert page.evaluate("pgraph.frame.isFront('Capture')")
    page.locator("[data-view=capture] button.close-trial").click()
    until(lambda: served.store.state.take is None, "no trial")
