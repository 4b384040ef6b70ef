
// Printed page: the scene as a picture, plots below it with the width of the page, no controls. Up to four plots share
// the page with the picture; more of them continue on further pages, each plot whole.

const SHARP = 2;  // picture pixels per page pixel
const PLOT = 190, PLOTS = 580, MAX_PLOTS = 4;  // heights: of a plot, of all plots of a page with the picture; their largest number

function printed({viewer, plots}, arrange) {
  const picture = document.createElement("canvas");
  picture.id = "picture";
  byId("pane").prepend(picture);
  window.addEventListener("beforeprint", () => {
    document.body.classList.add("paper");
    arrange();
    const n = plots.panes.length;
    plots.resize(n > MAX_PLOTS ? PLOT : Math.min(PLOT, PLOTS / n));
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
