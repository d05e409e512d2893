"use strict";
const AXES = {
  cycles: ["cycles of the rendering stage", false, true], fps: ["FPS at 1 GHz", true, true], psnr_db: ["PSNR, dB", true, false], ssim: ["SSIM", true, false],
  flip: ["FLIP", false, false], photo_psnr_db: ["PSNR against photographs, dB", true, false], photo_ssim: ["SSIM against photographs", true, false],
  area_ge: ["area, GE", false, false], work: ["cycles x area, G GE cycles", false, true], energy_uj: ["energy, uJ a frame", false, true],
};
const NS = "http://www.w3.org/2000/svg", svg = document.getElementById("scatter"), read = document.getElementById("read");
const W = 900, H = 480, L = 70, R = 20, T = 15, B = 45;
let kept = null;

for (const points of Object.values(DATA)) for (const p of points) {
  p.fps = p.cycles ? 1e9 / p.cycles : null;
  p.work = p.cycles && p.area_ge ? p.cycles * p.area_ge / 1e9 : null;
}

function choice(name, options, value) {
  const label = document.createElement("label"), select = document.createElement("select");
  label.append(name + " ", select);
  for (const [key, text] of options) select.add(new Option(text, key, key === value, key === value));
  select.addEventListener("change", draw);
  document.getElementById("controls").append(label);
  return select;
}
const axes = Object.entries(AXES).map(([k, v]) => [k, v[0]]);
const titles = Object.keys(DATA);
const view = choice("view", titles.map(t => [t, t]), titles[titles.length - 1]);
const xAxis = choice("x", axes, "cycles"), yAxis = choice("y", axes, "psnr_db");
const kind = choice("show", [["all", "all"], ["rtl", "those with RTL"], ["model", "model only"]], "all");

function add(name, attributes, text) {
  const e = document.createElementNS(NS, name);
  for (const k in attributes) e.setAttribute(k, attributes[k]);
  if (text !== undefined) e.textContent = text;
  svg.append(e);
  return e;
}
function show(n, digits) { return n === null || n === undefined ? "-" : n.toLocaleString("en", { maximumFractionDigits: digits }); }
function describe(p) {
  return `${p.config}\n${p.title || ""}\n${p.bound ? "masks for free: a bound, not a design" : p.model_only ? "model only, no RTL" : "RTL exists"}\n\ncycles   ${show(p.cycles, 0)}\nFPS      ${show(p.fps, 0)} at 1 GHz\n` +
    `PSNR     ${p.psnr_db === null ? "equal" : show(p.psnr_db, 2) + " dB"}\nSSIM     ${show(p.ssim, 5)}\nFLIP     ${show(p.flip, 5)}\nphoto    ${p.photo_psnr_db === null ? "none" : show(p.photo_psnr_db, 2) + " dB, SSIM " + show(p.photo_ssim, 4)}\narea     ${show(p.area_ge, 0)} GE\nenergy   ${show(p.energy_uj, 1)} uJ`;
}
function ticks(low, high, log) {
  const out = [];
  if (log) {
    for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++) for (const m of [1, 2, 5]) out.push(m * 10 ** e);
  } else {
    const raw = (high - low) / 6, unit = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].map(m => m * unit).find(s => s >= raw);
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) out.push(+v.toPrecision(10));
  }
  return out.filter(v => v >= low && v <= high);
}
function scale(values, log, from, to) {
  let low = Math.min(...values), high = Math.max(...values);
  if (log) { low /= 1.1; high *= 1.1; } else { const m = (high - low) * 0.06 || Math.abs(high) * 0.01 || 1; low -= m; high += m; }
  const f = log ? Math.log : v => v;
  return { low, high, at: v => from + (to - from) * (f(v) - f(low)) / (f(high) - f(low)) };
}
function draw() {
  svg.replaceChildren();
  const xk = xAxis.value, yk = yAxis.value, [xName, xUp, xLog] = AXES[xk], [yName, yUp, yLog] = AXES[yk];
  const points = DATA[view.value].filter(p => p[xk] !== null && p[yk] !== null && (kind.value === "all" || p.model_only === (kind.value === "model")));
  if (!points.length) { add("text", { x: W / 2, y: H / 2, "text-anchor": "middle" }, "nothing to show"); return; }
  const x = scale(points.map(p => p[xk]), xLog, L, W - R), y = scale(points.map(p => p[yk]), yLog, H - B, T);
  for (const v of ticks(x.low, x.high, xLog)) {
    add("line", { x1: x.at(v), x2: x.at(v), y1: T, y2: H - B, class: "grid" });
    add("text", { x: x.at(v), y: H - B + 15, "text-anchor": "middle" }, v.toLocaleString("en", { maximumSignificantDigits: 6 }));
  }
  for (const v of ticks(y.low, y.high, yLog)) {
    add("line", { x1: L, x2: W - R, y1: y.at(v), y2: y.at(v), class: "grid" });
    add("text", { x: L - 6, y: y.at(v) + 4, "text-anchor": "end" }, v.toLocaleString("en", { maximumSignificantDigits: 6 }));
  }
  add("text", { x: (L + W - R) / 2, y: H - 8, "text-anchor": "middle" }, xName + (xUp ? " (more is better)" : " (less is better)"));
  add("text", { x: 14, y: (T + H - B) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(T + H - B) / 2})` }, yName + (yUp ? " (more is better)" : " (less is better)"));
  const cost = p => xUp ? -p[xk] : p[xk], gain = p => yUp ? p[yk] : -p[yk];
  let best = -Infinity;
  const front = points.filter(p => !p.bound).sort((a, b) => cost(a) - cost(b) || gain(b) - gain(a)).filter(p => gain(p) > best && ((best = gain(p)), true));
  add("polyline", { class: "front", points: front.map(p => `${x.at(p[xk])},${y.at(p[yk])}`).join(" ") });
  front.forEach((p, i) => add("text", { x: x.at(p[xk]) + 6, y: y.at(p[yk]) + (i % 2 ? -6 : 13) }, p.config));
  for (const p of points) {
    const mark = add("circle", { cx: x.at(p[xk]), cy: y.at(p[yk]), r: 5, tabindex: 0, "data-config": p.config,
      class: "point" + (p.bound ? " bound" : p.model_only ? " model" : "") + (kept === p.config ? " chosen" : "") });
    mark.append(Object.assign(document.createElementNS(NS, "title"), { textContent: describe(p) }));
    const look = () => { read.textContent = describe(p); };
    const rest = () => { const k = points.find(q => q.config === kept); read.textContent = k ? describe(k) : "no point chosen"; };
    mark.addEventListener("mouseenter", look);
    mark.addEventListener("focus", look);
    mark.addEventListener("mouseleave", rest);
    mark.addEventListener("click", () => { kept = kept === p.config ? null : p.config; draw(); rest(); });
  }
}
draw();
