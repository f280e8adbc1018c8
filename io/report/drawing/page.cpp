#include "io/report/drawing/page.h"

namespace megablock::report {

namespace {

constexpr const char* kStyle = R"css(
:root{--ink:#1c2733;--muted:#5f6c79;--line:#dfe5ea;--paper:#fff;--ground:#f4f6f8;--accent:#1f6f8b;--bar:#6fa3b5;
--good:#2e7d4f;--look:#b26a00;--bad:#b3261e}
*{box-sizing:border-box}
body{margin:0;background:var(--ground);color:var(--ink);font:15px/1.5 system-ui,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif}
main,header>div{max-width:1120px;margin:0 auto;padding:0 16px}
header{background:var(--ink);color:#fff;padding:18px 0 16px}
header h1{margin:0;font-size:24px;font-weight:600}
header p{margin:2px 0 0;color:#c3ced8;font-size:14px;overflow-wrap:anywhere}
section{background:var(--paper);border:1px solid var(--line);border-radius:8px;padding:14px 18px 16px;margin:16px 0}
h2{font-size:18px;margin:0 0 8px;font-weight:600}
h3{font-size:15px;margin:14px 0 4px;font-weight:600}
p{margin:4px 0 10px}
a{color:var(--accent)}
code{font:13px ui-monospace,Menlo,Consolas,monospace}
.muted,figcaption{color:var(--muted);font-size:13px}
.cards{display:grid;grid-template-columns:repeat(auto-fill,minmax(205px,1fr));gap:10px;margin:16px 0}
.card{background:var(--paper);border:1px solid var(--line);border-radius:8px;padding:10px 14px;display:flex;flex-direction:column}
.card b{font-size:23px;font-weight:600;line-height:1.25}
.card i{font-style:normal;font-size:14px;font-weight:400;color:var(--muted)}
.card span{font-size:13px}
.card small{color:var(--muted);font-size:12px}
.assessment{list-style:none;background:var(--paper);border:1px solid var(--line);border-radius:8px;margin:0;padding:10px 18px}
main>.assessment:first-child{margin-top:16px}
.assessment li{padding:2px 0 2px 20px;position:relative}
.assessment li::before{content:"";position:absolute;left:0;top:9px;width:10px;height:10px;border-radius:5px;background:#9aa7b3}
.assessment .good::before{background:var(--good)}
.assessment .look::before{background:var(--look);border-radius:1px}
.assessment .bad::before{background:var(--bad);border-radius:0;transform:rotate(45deg)}
.assessment .bad{color:var(--bad)}
.row{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,430px),1fr));gap:14px 26px;align-items:start}
.row>:only-child{grid-column:1/-1}
.row>figure:only-child{max-width:640px}
figure{margin:0}
figure svg{width:100%;height:auto;display:block}
.aside{min-width:0}
.wide,.tall{overflow-x:auto}
.wide::-webkit-scrollbar,.tall::-webkit-scrollbar{height:9px;width:9px}
.wide::-webkit-scrollbar-thumb,.tall::-webkit-scrollbar-thumb{background:#a9b5c0;border-radius:5px}
.wide::-webkit-scrollbar-track,.tall::-webkit-scrollbar-track{background:var(--ground)}
.cut::before{content:"more columns: scroll sideways →";position:sticky;left:0;display:inline-block;color:var(--look);font-size:12px}
table{border-collapse:collapse;width:100%;font-size:14px;font-variant-numeric:tabular-nums}
th,td{text-align:right;padding:3px 8px;border-bottom:1px solid var(--line);white-space:nowrap}
th{color:var(--muted);font-weight:500;font-size:13px}
.t{text-align:left}
.compact{max-width:720px}
td.note{white-space:normal;min-width:15em}
td.long{white-space:normal;overflow-wrap:anywhere;min-width:15em}
th:first-child,td:first-child{padding-left:0}
tr.sum td{font-weight:600}
tr.bad td{color:var(--bad)}
tr.look td{color:var(--look)}
tr.muted td,tr.weak td{color:var(--muted)}
tr.weak td:first-child::after{content:" (not significant)";font-size:12px}
details{margin:8px 0 4px}
summary{cursor:pointer;color:var(--accent)}
.tall{max-height:70vh;overflow:auto}
.tall .wide{overflow-x:visible}
.tall thead th{position:sticky;top:0;background:var(--paper)}
table.small{font-size:13px}
table.small td.t{white-space:nowrap}
.sortable th{cursor:pointer}
.sortable th[aria-sort=ascending]::after{content:" ▲"}
.sortable th[aria-sort=descending]::after{content:" ▼"}
table.plain thead{display:none}
table.plain td:first-child{color:var(--muted);width:11em}
.correlation{width:auto;font-size:13px;margin-top:8px}
.correlation .r{display:block;margin:-3px -8px;padding:3px 8px;background:rgba(178,106,0,calc(var(--r)*var(--r)*.6))}
figure+figure{margin-top:12px}
.row figure+figure{margin-top:0}
.stages td:nth-child(2){width:45%}
.time{display:block;height:10px;background:var(--bar);border-radius:2px;min-width:1px}
.names{font-size:13px;overflow-wrap:anywhere}
svg text{font:11px system-ui,"Segoe UI",Roboto,Arial,sans-serif;fill:var(--muted)}
svg .title{fill:var(--ink);font-size:12px}
.grid{stroke:var(--line)}
.axis{stroke:#8b98a5}
.bar{fill:var(--bar)}
.curve{fill:none;stroke:#b26a00;stroke-width:1.5}
.frame{fill:#fbfcfd;stroke:var(--line)}
.shade{fill:#6fa3b5}
.strip{fill:var(--paper)}
.foot{stroke:#1c2733;stroke-width:2.6;stroke-linecap:round}
.arrow{fill:none;stroke:#1c2733;stroke-width:1.2}
.dot{fill:var(--accent);fill-opacity:.65}
.out{fill:none;stroke:var(--bad)}
.stem{stroke:var(--bar);fill:none}
.map{border-radius:6px;touch-action:pan-y;cursor:grab}
.map .points{stroke:#b9c3cc;stroke-width:1.6;stroke-linecap:round;fill:none}
.map .dots,.map .boundary{stroke-linecap:round;fill:none}
.map .boundary{stroke:#1c2733}
.map .meridian{stroke:#e3e9ee;fill:none}
.map .coordinate text{fill:#1c2733;font-size:14px;paint-order:stroke;stroke:#fff;stroke-width:3.5px;stroke-linejoin:round}
.map .ellipses{fill:none;stroke:#1c2733;stroke-width:1.1}
.map .ellipses path{stroke:#b26a00}
.map .within{stroke:#8b98a5;stroke-width:.7;fill:none;opacity:.7}
.map .across{stroke:#b3261e;stroke-width:.9;fill:none;opacity:.7}
.map .lost{stroke:var(--bad);stroke-width:2;fill:none}
.map .control{fill:#111;stroke:#fff}
.map .check{fill:#fff;stroke:#111;stroke-width:1.5}
.map .scale rect{fill:#fff;fill-opacity:.85}
.map .scale path{stroke:#1c2733;stroke-width:1.5;fill:none}
.map .scale .needle{fill:#1c2733;stroke:none}
.map .scale text{font-size:14px;fill:#1c2733}
.map .foot-print{fill:#4e79a7;fill-opacity:.05;stroke:#4e79a7;stroke-opacity:.35;stroke-width:.6}
.map .thin{fill:var(--bad);fill-opacity:.28;stroke:none}
.map .gap{stroke:var(--bad);stroke-width:2.5;fill:none;stroke-dasharray:7 4}
.map .weak{stroke:#b26a00;stroke-width:1.6;fill:none;stroke-dasharray:3 3}
.map .single{stroke:#b26a00;stroke-width:3;fill:none}
.map .proposal{fill:#fff;stroke:var(--good);stroke-width:2}
.map .number circle{fill:#fff;stroke:var(--bad);stroke-width:1.5}
.map .number text{fill:var(--bad);font-size:13px;font-weight:600}
.key .swatch{border-radius:2px;width:16px}
[hidden]{display:none}
.legend,.controls{display:flex;flex-wrap:wrap;gap:4px 18px;font-size:13px;margin:2px 0 8px;align-items:center}
.key{display:inline-flex;align-items:center;gap:6px}
.key i{width:11px;height:11px;border-radius:6px;display:inline-block}
.tilekey{background:linear-gradient(90deg,#4e79a7 0 33%,#f28e2b 33% 66%,#59a14f 66%)}
.ringkey{background:#4e79a7;border:2px solid #1c2733}
.key .pointkey{width:5px;height:5px;background:#b9c3cc}
.lostkey{color:var(--bad)}
button{font:inherit;padding:1px 10px;border:1px solid var(--line);border-radius:4px;background:var(--ground);cursor:pointer}
footer{color:var(--muted);font-size:12px;padding:0 0 24px}
@media(max-width:560px){body{font-size:14px}section{padding:12px}.cards{grid-template-columns:1fr 1fr}.card b{font-size:19px}
.assessment{padding:8px 12px}td,th{padding:3px 5px}}
@media print{body{background:#fff;font-size:11px}header{background:none;color:#000;padding:0}header p{color:#444}
section,.card,.assessment{border-color:#bbb}figure,tr,.card{break-inside:avoid}h2,h3{break-after:avoid}.controls{display:none}
main,header>div{max-width:none;padding:0}.row{grid-template-columns:1fr 1fr}figure .map{max-height:150mm}
.cut::before{display:none}
*{-webkit-print-color-adjust:exact;print-color-adjust:exact}}
)css";

// The script of the page. It shows and hides layers, enlarges maps by wheel or two fingers and moves them by dragging
// (by changing their view box), and sorts tables after a click on a heading.
constexpr const char* kScript = R"js(
(() => {
  const maps = [...document.querySelectorAll('.map')];
  for (const box of document.querySelectorAll('[data-layer]'))
    box.addEventListener('change', () => {
      for (const e of document.querySelectorAll('.map .layer.' + box.dataset.layer)) e.toggleAttribute('hidden', !box.checked);
    });
  const restore = [];
  for (const map of maps) {
    const whole = map.getAttribute('viewBox').split(' ').map(Number);
    let view = whole.slice();
    const show = () => map.setAttribute('viewBox', view.join(' '));
    restore.push(() => { view = whole.slice(); show(); });
    const at = e => {
      const r = map.getBoundingClientRect();
      return [(e.clientX - r.left) / r.width, (e.clientY - r.top) / r.height];
    };
    const enlarge = (factor, [x, y]) => {
      const width = Math.min(whole[2], Math.max(whole[2] / 60, view[2] / factor)), height = width * whole[3] / whole[2];
      view = [view[0] + x * (view[2] - width), view[1] + y * (view[3] - height), width, height];
      show();
    };
    map.addEventListener('wheel', e => {
      if (!e.ctrlKey && view[2] === whole[2] && e.deltaY > 0) return;
      e.preventDefault();
      enlarge(Math.exp(-e.deltaY / 400), at(e));
    }, {passive: false});
    const fingers = new Map();
    map.addEventListener('pointerdown', e => { fingers.set(e.pointerId, at(e)); map.setPointerCapture(e.pointerId); });
    map.addEventListener('pointermove', e => {
      if (!fingers.has(e.pointerId)) return;
      const before = [...fingers.values()], from = fingers.get(e.pointerId), to = at(e);
      fingers.set(e.pointerId, to);
      const after = [...fingers.values()];
      const gap = p => Math.hypot(p[0][0] - p[1][0], p[0][1] - p[1][1]);
      if (after.length === 2) enlarge(gap(after) / Math.max(1e-3, gap(before)), to);
      else { view[0] -= (to[0] - from[0]) * view[2]; view[1] -= (to[1] - from[1]) * view[3]; show(); }
    });
    for (const end of ['pointerup', 'pointercancel']) map.addEventListener(end, e => fingers.delete(e.pointerId));
  }
  const boxes = [...document.querySelectorAll('.wide,.tall')];
  const hint = () => { for (const e of boxes) e.classList.toggle('cut', e.scrollWidth > e.clientWidth + 1 &&
    getComputedStyle(e).overflowX === 'auto'); };
  addEventListener('resize', hint);
  for (const e of document.querySelectorAll('details')) e.addEventListener('toggle', hint);
  hint();
  const whole = document.getElementById('whole');
  if (whole) whole.addEventListener('click', () => restore.forEach(f => f()));
  const numberIn = cell => {
    const text = cell.textContent, number = parseFloat(text.replace(/\u202f/g, '').replace('\u2212', '-'));
    return Number.isNaN(number) ? text : number;
  };
  const compare = (a, b) => typeof a === typeof b ? (a < b ? -1 : a > b ? 1 : 0) : typeof a === 'number' ? -1 : 1;
  for (const table of document.querySelectorAll('table.sortable'))
    [...table.tHead.rows[0].cells].forEach((heading, column) => heading.addEventListener('click', () => {
      const up = heading.getAttribute('aria-sort') !== 'ascending', names = heading.classList.contains('t');
      for (const cell of table.tHead.rows[0].cells) cell.removeAttribute('aria-sort');
      heading.setAttribute('aria-sort', up ? 'ascending' : 'descending');
      const key = row => names ? row.cells[column].textContent : numberIn(row.cells[column]);
      const rows = [...table.tBodies[0].rows], sums = rows.filter(r => r.classList.contains('sum'));
      const others = rows.filter(r => !r.classList.contains('sum'));
      others.sort((a, b) => (up ? 1 : -1) * compare(key(a), key(b)));
      table.tBodies[0].append(...others, ...sums);
    }));
})();
)js";

}  // namespace

std::string page(const std::string& title, const std::string& subtitle, const std::string& body,
                 const std::string& json) {
  return "<!DOCTYPE html>\n<html lang=en>\n<head>\n<meta charset=utf-8>\n"
         "<meta name=viewport content=\"width=device-width, initial-scale=1\">\n<title>" +
         title + "</title>\n<style>" + kStyle + "</style>\n</head>\n<body>\n<header><div><h1>" + title + "</h1><p>" +
         subtitle + "</p></div></header>\n<main>\n" + body +
         "<footer>megablock. Lengths in the ground frame; image residuals are adjusted − measured, in "
         "pixels.</footer>\n"
         "</main>\n<script type=\"application/json\" id=\"figures\">\n" +
         json + "\n</script>\n<script>" + kScript + "</script>\n</body>\n</html>\n";
}

}  // namespace megablock::report
