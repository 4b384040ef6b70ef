
// On paper: the scene as a picture, plots under it as wide as the page, nothing to click.

const SHARP = 2, PLOT = 190;  // pixels of the picture for one of the page; height of a plot

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
    picture.getContext("2d").drawImage(renderer.domElement, 0, 0);  // what a scene holds is gone after its frame
    renderer.setPixelRatio(ratio);
  });
  window.addEventListener("afterprint", () => {
    document.body.classList.remove("paper");
    arrange();
  });
}
