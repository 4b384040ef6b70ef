
// Printed page: the scene as a picture, plots below it with the width of the page, no controls.

const SHARP = 2, PLOT = 190;  // picture pixels per page pixel; height of a plot

function printed({viewer, plots}, arrange) {
  const picture = document.createElement("canvas");
  picture.id = "picture";
  byId("pane").prepend(picture);
  window.addEventListener("beforeprint", () => {
    document.body.classList.add("paper");
    arrange();
    plots.resize(PLOT);
    const {renderer} = viewer, ratio = renderer.getPixelRatio();
    renderer.setPixelRatio(SHARP);
    viewer.render();
    [picture.width, picture.height] = [renderer.domElement.width, renderer.domElement.height];
    picture.getContext("2d").drawImage(renderer.domElement, 0, 0);  // the drawing buffer is cleared after the frame
    renderer.setPixelRatio(ratio);
  });
  window.addEventListener("afterprint", () => {
    document.body.classList.remove("paper");
    arrange();
  });
}
