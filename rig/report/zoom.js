"use strict";
// Zoom into the plots and copy commands. Without this script the page shows the same, at one scale.
for (const figure of document.querySelectorAll("figure.plot")) {
  const svg = figure.querySelector("svg");
  const [left, top, width, height] = svg.dataset.box.split(" ").map(Number);
  const axes = [svg.dataset.x, svg.dataset.y].map((text) => {
    const [low, high, kind] = text.split(" ");
    const log = kind === "log", turned = (value) => (log ? Math.log10(Number(value)) : Number(value));
    return { log, low: turned(low), high: turned(high) };
  });
  const whole = [0, 1, 0, 1];
  let shown = whole.slice(); // shares of both axes: x from, to, y from, to
  const data = svg.querySelector(".data");
  const make = (name, attributes, text) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const key in attributes) node.setAttribute(key, attributes[key]);
    if (text !== undefined) node.textContent = text;
    return node;
  };
  const valueAt = (axis, share) => {
    const value = axis.low + share * (axis.high - axis.low);
    return axis.log ? 10 ** value : value;
  };
  const words = (value, digits = 6) => String(parseFloat(value.toPrecision(digits))).replaceAll("-", "−");
  const ticks = (axis, from, to) => {
    let low = valueAt(axis, from), high = valueAt(axis, to), found = [];
    if (axis.log && high / low >= 10) {
      for (const factors of [[1, 2, 5], [1]]) {
        found = [];
        for (let k = Math.floor(Math.log10(low)); k <= Math.ceil(Math.log10(high)); k++)
          for (const factor of factors) if (factor * 10 ** k >= low && factor * 10 ** k <= high) found.push(factor * 10 ** k);
        if (found.length <= 10) break;
      }
      return found;
    }
    const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((value) => value >= raw);
    for (let k = Math.ceil(low / step); k <= Math.floor(high / step); k++) found.push(k * step);
    return found;
  };
  const shareOf = (axis, value) => ((axis.log ? Math.log10(value) : value) - axis.low) / (axis.high - axis.low);
  const draw = () => {
    const [x0, x1, y0, y1] = shown, kx = 1 / (x1 - x0), ky = 1 / (y1 - y0);
    const dx = left * (1 - kx) - kx * x0 * width, dy = top * (1 - ky) - ky * (1 - y1) * height;
    data.setAttribute("transform", `matrix(${kx} 0 0 ${ky} ${dx} ${dy})`);
    const across = (value) => left + ((shareOf(axes[0], value) - x0) * width) / (x1 - x0);
    const down = (value) => top + height - ((shareOf(axes[1], value) - y0) * height) / (y1 - y0);
    svg.querySelector(".x-ticks").replaceChildren(
      ...ticks(axes[0], x0, x1).flatMap((value) => {
        const x = across(value);
        return [make("line", { x1: x, x2: x, y1: top, y2: top + height }),
          make("text", { x, y: top + height + 16 }, words(value))];
      }));
    svg.querySelector(".y-ticks").replaceChildren(
      ...ticks(axes[1], y0, y1).flatMap((value) => {
        const y = down(value);
        return [make("line", { x1: left, x2: left + width, y1: y, y2: y }),
          make("text", { x: left - 5, y: y + 4 }, words(value))];
      }));
    const k = (x1 - x0), shift = -x0 / k;
    for (const mark of svg.querySelectorAll(".marks > *")) {
      mark.dataset.share ??= (Number(mark.getAttribute("x1") ?? mark.getAttribute("x")) - left) / width;
      const share = Number(mark.dataset.share) / k + shift, x = left + share * width;
      for (const name of mark.tagName === "line" ? ["x1", "x2"] : ["x"]) mark.setAttribute(name, x);
      mark.style.display = share < 0 || share > 1 ? "none" : "";
    }
    figure.dataset.zoomed = String(shown.some((share, k) => Math.abs(share - whole[k]) > 1e-9));
    back.disabled = figure.dataset.zoomed !== "true";
    // a finger that moves over a zoomed plot moves the plot, else the page
    svg.style.touchAction = figure.dataset.zoomed === "true" ? "none" : "pan-y";
  };
  const clamp = (from, to) => {
    const span = Math.min(Math.max(to - from, 1e-5), 1), start = Math.min(Math.max(from, 0), 1 - span);
    return [start, start + span];
  };
  const show = (x0, x1, y0, y1) => { shown = [...clamp(x0, x1), ...clamp(y0, y1)]; draw(); };
  const zoom = (factor, fx = 0.5, fy = 0.5) => {
    const [x0, x1, y0, y1] = shown, cx = x0 + fx * (x1 - x0), cy = y0 + fy * (y1 - y0);
    show(cx - (cx - x0) * factor, cx + (x1 - cx) * factor, cy - (cy - y0) * factor, cy + (y1 - cy) * factor);
  };
  const pan = (fx, fy) => {
    const [x0, x1, y0, y1] = shown;
    show(x0 + fx * (x1 - x0), x1 + fx * (x1 - x0), y0 + fy * (y1 - y0), y1 + fy * (y1 - y0));
  };
  const shares = (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [(at.x - left) / width, 1 - (at.y - top) / height];
  };
  const bar = document.createElement("div"), read = document.createElement("output");
  bar.className = "tools";
  const button = (text, name, action) => {
    const node = document.createElement("button");
    Object.assign(node, { type: "button", textContent: text, title: name });
    node.setAttribute("aria-label", `${name}: ${figure.querySelector("b").textContent}`);
    node.addEventListener("click", action);
    bar.append(node);
    return node;
  };
  button("+", "Zoom in", () => zoom(0.5));
  button("−", "Zoom out", () => zoom(2));
  const back = button("whole", "Whole plot", () => show(...whole));
  bar.append(read);
  svg.before(bar);
  svg.tabIndex = 0;
  const keys = { "+": () => zoom(0.5), "=": () => zoom(0.5), "-": () => zoom(2), 0: () => show(...whole),
    Escape: () => show(...whole), ArrowLeft: () => pan(-0.2, 0), ArrowRight: () => pan(0.2, 0),
    ArrowUp: () => pan(0, 0.2), ArrowDown: () => pan(0, -0.2) };
  svg.addEventListener("keydown", (event) => {
    const scrolls = event.key.startsWith("Arrow") && figure.dataset.zoomed !== "true";
    if (event.ctrlKey || event.metaKey || event.altKey || scrolls || !Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    keys[event.key]();
  });
  let start = null, frame = null;
  const lift = () => { start = null; frame?.remove(); frame = null; };
  svg.addEventListener("pointerdown", (event) => {
    const [x, y] = shares(event);
    if (event.button !== 0 || x < 0 || x > 1 || y < 0 || y > 1) return;
    const moves = event.pointerType === "touch" || event.shiftKey;
    if (moves && figure.dataset.zoomed !== "true") return;
    start = { x, y, moves };
    svg.setPointerCapture(event.pointerId);
    if (!moves) svg.append((frame = make("rect", { class: "choice" })));
  });
  svg.addEventListener("pointermove", (event) => {
    const [x, y] = shares(event), [x0, x1, y0, y1] = shown;
    if (x >= 0 && x <= 1 && y >= 0 && y <= 1)
      read.textContent = `${words(valueAt(axes[0], x0 + x * (x1 - x0)), 4)}, ${words(valueAt(axes[1], y0 + y * (y1 - y0)), 4)}`;
    if (start?.moves) { pan(start.x - x, start.y - y); start.x = x; start.y = y; }
    if (!frame) return;
    const inside = (share) => Math.min(Math.max(share, 0), 1), xs = [start.x, inside(x)].sort((a, b) => a - b);
    const ys = [start.y, inside(y)].sort((a, b) => a - b);
    const place = { x: left + xs[0] * width, y: top + (1 - ys[1]) * height, width: (xs[1] - xs[0]) * width,
      height: (ys[1] - ys[0]) * height };
    for (const key in place) frame.setAttribute(key, place[key]);
    frame.choice = [...xs, ...ys];
  });
  svg.addEventListener("pointerup", () => {
    const choice = frame?.choice, [x0, x1, y0, y1] = shown;
    lift();
    if (!choice || choice[1] - choice[0] < 0.01 || choice[3] - choice[2] < 0.01) return;
    show(x0 + choice[0] * (x1 - x0), x0 + choice[1] * (x1 - x0), y0 + choice[2] * (y1 - y0), y0 + choice[3] * (y1 - y0));
  });
  svg.addEventListener("pointercancel", lift);
  svg.addEventListener("dblclick", () => show(...whole));
  draw();
}
for (const code of document.querySelectorAll("pre.command")) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "copy";
  button.setAttribute("aria-label", `Copy the command ${code.textContent}`);
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(code.textContent);
      button.textContent = "copied";
    } catch {
      getSelection().selectAllChildren(code);
      button.textContent = "selected";
    }
  });
  code.after(button);
}
