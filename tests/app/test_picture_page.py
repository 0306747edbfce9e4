"""The picture that the page copies."""

from .on_page import notice


def test_a_picture_of_the_view_and_the_curves_is_copied(page, served):
    """Where the browser keeps the clipboard closed, the picture is downloaded."""
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.get_by_role("button", name="Export").click()
    page.get_by_role("menuitem", name="Copy picture").click()
    notice(page, "Copied a picture")
    size = page.evaluate(
        """async () => {
          const [item] = await navigator.clipboard.read(),
            picture = await createImageBitmap(await item.getType("image/png")),
            view = window.__viserMutable.canvas;
          return [picture.width - view.width, picture.height - view.height];
        }"""
    )
    assert size[0] == 0
    assert size[1] > 30  # with a caption below the view
    page.context.clear_permissions()
    page.evaluate(
        "() => { navigator.clipboard.write = () => Promise.reject(new Error('closed')); }"
    )
    with page.expect_download() as saved:
        page.evaluate("pgraph.copyPicture()")
    assert saved.value.suggested_filename == "leg.png"
    notice(page, "downloaded")
    page.evaluate("delete navigator.clipboard.write")
