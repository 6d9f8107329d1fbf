#include "understory/output/report/page_files.h"
#include "understory/output/report/report_parts.h"

namespace understory {

std::string report_style() {
  std::string style = R"(
:root{--bg:#fbfbf9;--card:#fff;--text:#1d2320;--soft:#5f6b64;--rule:#d9ded9;--line:#2f6f9f;
--good:#2e7d4f;--fair:#b7791f;--bad:#b3372b;--path:#1769c2;--weak:#e8710a;--lost:#c5221f;--loop:#8e3ab8}
@media (prefers-color-scheme:dark){:root{--bg:#151816;--card:#1e2320;--text:#e6ebe7;--soft:#9aa8a0;
--rule:#38413b;--line:#6db1e2;--good:#5cb584;--fair:#e0a94a;--bad:#ee7b6f}}
@media print{:root{--bg:#fff;--card:#fff;--text:#000;--soft:#444;--rule:#bbb}
section{break-inside:avoid}.scroll,.wide{max-height:none!important;overflow:visible!important}}
*{box-sizing:border-box}
body{margin:0;background:var(--bg);color:var(--text);font:16px/1.5 system-ui,sans-serif}
main{max-width:1180px;margin:0 auto;padding:24px 20px 60px}
h1{font-size:1.7rem;margin:0;overflow-wrap:anywhere}h2{font-size:1.2rem;margin:0 0 .5rem}
h3{font-size:1rem;margin:1.2rem 0 .4rem}
.sub{color:var(--soft);margin:.1rem 0 1rem}
section{background:var(--card);border:1px solid var(--rule);border-radius:8px;padding:16px 18px;margin:0 0 16px}
.verdict{border-left:8px solid var(--good)}.verdict.fair{border-left-color:var(--fair)}
.verdict.bad{border-left-color:var(--bad)}.verdict h2{margin:0;color:var(--good)}
.verdict.fair h2{color:var(--fair)}.verdict.bad h2{color:var(--bad)}.verdict p,.verdict ul{margin:.2rem 0 0}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(170px,1fr));gap:12px}
.meanings{margin-top:12px}.meanings summary{font-weight:400;color:var(--soft)}
dl{margin:.4rem 0 0;font-size:.9rem}dt{font-weight:600;margin-top:.4rem}dd{margin:0;color:var(--soft)}
.tile b{display:block;white-space:nowrap;font-size:1.35rem;font-variant-numeric:tabular-nums}
.tile span{color:var(--soft);font-size:.85rem;line-height:1.25;display:block}
.paper{background:#fff;border:1px solid var(--rule);border-radius:4px}
svg{display:block;width:100%;height:auto}
svg.plot{max-width:1100px}svg.plot text{fill:var(--soft);font-size:12px}
.paper text{font-family:system-ui,sans-serif}
.grid{stroke:var(--rule);stroke-width:1}.axis{stroke:var(--soft);stroke-width:1;fill:none}
.line{fill:none;stroke-width:1.4}.level{stroke:var(--bad);stroke-width:1.2;stroke-dasharray:6 4}
.bar{fill:var(--good)}
.two{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(420px,100%),1fr));gap:16px;align-items:start}
.two figure{max-width:620px}.panels{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(430px,100%),1fr));gap:14px}
.panels.one{grid-template-columns:minmax(0,900px)}
.trees{display:flex;flex-wrap:wrap;gap:14px}.trees figure{width:165px}.trees.matrices figure{width:350px;max-width:100%}
figure{margin:0}figcaption{font-size:.85rem;color:var(--soft);margin-top:4px}
.legend{font-size:.88rem;color:var(--soft);margin:.5rem 0 0}.legend span{white-space:nowrap;
margin-right:12px}.legend i{display:inline-block;width:22px;height:0;border-top:4px solid;margin:0 5px 3px 0}
.legend i.dot{width:11px;height:11px;border-width:2px;border-style:solid;
border-radius:50%;margin-bottom:-1px}.legend i.box{width:13px;height:13px;border:0;margin-bottom:-2px}
table{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums}
th,td{text-align:left;padding:3px 14px 3px 0;border-bottom:1px solid var(--rule);vertical-align:top}
th.n,td.n{text-align:right}table.sort th{cursor:pointer;white-space:nowrap;background:var(--card)}
table.sort th:hover{color:var(--line)}table.figures th{white-space:normal}
table.figures td{white-space:nowrap}
.scroll{max-height:460px;overflow:auto}.wide{overflow-x:auto}code{font-size:.85em;overflow-wrap:anywhere}
pre{overflow:auto;font-size:.82rem;max-height:480px}
.files code{white-space:nowrap}
@media (max-width:640px){svg.map text{font-size:38px}.panels text{font-size:34px}main{padding:12px 8px 40px}section{padding:12px}
.wide svg.plot{min-width:860px}.tiles{grid-template-columns:repeat(auto-fit,minmax(130px,1fr))}.tile b{white-space:normal}}
li,p,td,summary,figcaption{overflow-wrap:anywhere}.wide td,.wide th,.scroll td{overflow-wrap:normal}
.warn{margin:0;padding-left:1.2rem}.so{color:var(--soft)}
summary{cursor:pointer;font-weight:600}
)";
  for (const PageFile& file : page_styles())
    style += file.text;
  return style;
}

// The page is complete without them.
std::string report_script() {
  std::string script;
  for (const PageFile& file : page_scripts())
    script += file.text;
  return script;
}

}  // namespace understory
