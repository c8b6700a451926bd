(() => {
const data = DATA;
const box = document.currentScript.closest(".playground"), find = name => box.querySelector(name);
for (const image of box.querySelectorAll("img")) {
  const address = image.getAttribute("src"), holder = document.createElement("template");
  holder.innerHTML = decodeURIComponent(address.slice(address.indexOf(",") + 1));
  image.replaceWith(holder.content);
}
const pictures = [...box.querySelectorAll(".panels > svg")];
const paths = pictures.map(picture => [...picture.querySelectorAll(".c")]);
const controls = find(".controls"), said = find(".said");
controls.textContent = "";
const inputs = data.sliders.map(slider => {
  const label = document.createElement("label"), name = document.createElement("span");
  const input = document.createElement("input"), value = document.createElement("output");
  name.textContent = slider.name;
  input.type = "range";
  input.min = 0;
  input.max = slider.values.length - 1;
  input.value = slider.start;
  input.setAttribute("aria-label", slider.name);
  input.dataset.lmSuppressShortcuts = "";  /* in JupyterLab an arrow would go to the next cell */
  input.addEventListener("input", draw);
  label.append(name, input, value);
  controls.append(label);
  return input;
});
function take(held, at) {
  const from = held.n * held.s.reduce((sum, stride, k) => sum + stride * at[k], 0);
  return held.v.slice(from, from + held.n);
}
function path(curve, scale, at) {
  let [x, y] = [take(curve.x, at), take(curve.y, at)];
  if (curve.look === "round") {
    [x, y] = [x, y].map(([m, c, s]) => Array.from({length: 49}, (_, k) => m + c * Math.cos(Math.PI * k / 24) + s * Math.sin(Math.PI * k / 24)));
  }
  const dots = ".o".includes(curve.look);
  let text = "", pen = "M";
  for (let k = 0; k < x.length; k++) {
    if (x[k] === null || y[k] === null) { pen = "M"; continue; }
    const [px, py] = [x[k], y[k]].map((w, axis) => Math.floor((scale[axis][0] + scale[axis][1] * w) * 10 + 0.5) / 10);
    text += pen + px + " " + py + (dots ? "h0" : "");
    pen = dots ? "M" : "L";
  }
  return text;
}
function draw() {
  const at = inputs.map(input => +input.value);
  inputs.forEach((input, k) => {
    const value = data.sliders[k].values[at[k]];
    input.nextSibling.textContent = value;
    input.setAttribute("aria-valuetext", value);
  });
  data.panels.forEach((panel, p) => panel.curves.forEach((curve, c) => paths[p][c].setAttribute("d", path(curve, panel.scale, at))));
  const numbers = take(data.numbers, at);
  said.textContent = data.words.map((word, k) => word + (numbers[k] ?? "")).join("");
}
draw();
})();
