#include "tools/publish/report/html.h"

#include "pipeline/io/markup.h"

namespace texmesh {
namespace {

constexpr std::string_view kStyle = R"(
:root{color-scheme:light dark;--page:#fff;--text:#1c1d20;--quiet:#585c64;--line:#d5d8dd;--card:#f4f5f7;
--good:#186a3b;--bad:#a61b1b;--a:#1f5fae;--b:#b3540b;--c:#22794d;--d:#8a2f9c;--e:#8a6d00}
@media (prefers-color-scheme:dark){:root{--page:#17181b;--text:#e8e9ec;--quiet:#a6abb5;--line:#3a3d44;--card:#212328;
--good:#63cf94;--bad:#ff8f8a;--a:#79b0f5;--b:#f0a05a;--c:#68c994;--d:#d690e6;--e:#dcbf55}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:70rem;padding:1.5rem;background:var(--page);color:var(--text);
font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,sans-serif}
h1{font-size:1.9rem;line-height:1.2;margin:0 0 .5rem;overflow-wrap:anywhere}
h2{font-size:1.35rem;margin:2.75rem 0 .5rem;padding-top:.75rem;border-top:1px solid var(--line)}
h3{font-size:1.05rem;margin:1.75rem 0 .5rem}
p{margin:.5rem 0;max-width:46rem;overflow-wrap:anywhere}
.quiet,figcaption,caption{color:var(--quiet);font-size:.9rem}
header{display:flex;gap:1.5rem;align-items:flex-start;flex-wrap:wrap}
header>div{flex:1 1 24rem}
header img{width:12rem;height:auto;border-radius:.5rem;display:block}
.verdict{font-size:1.1rem;padding:.7rem 1rem;border-left:.35rem solid var(--good);background:var(--card);border-radius:.25rem}
.verdict.bad{border-color:var(--bad)}
.good{color:var(--good);font-weight:600}.bad{color:var(--bad);font-weight:600}.verdict.bad{color:inherit;font-weight:inherit}
nav ul{display:flex;flex-wrap:wrap;gap:.25rem 1.25rem;list-style:none;padding:0;margin:1rem 0 0}
a{color:var(--a)}
figure{margin:1rem 0 1.75rem}
.row{display:grid;grid-template-columns:repeat(auto-fit,minmax(12rem,1fr));gap:.6rem}
.row+.row{margin-top:1rem}
.row>div{min-width:0}
.row p{margin:.25rem 0 0}
.row img,.map{display:block;max-width:100%;height:auto;border-radius:.3rem}
.heat image{filter:grayscale(1)}
.enlarged{image-rendering:pixelated}
.scroll{overflow-x:auto}
table{border-collapse:collapse;margin:1rem 0;font-variant-numeric:tabular-nums}
caption{text-align:left;padding-bottom:.35rem}
th,td{padding:.3rem .7rem;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}
th:first-child,.sentences td,.sentences th{text-align:left}
.sentences td{white-space:normal;overflow-wrap:anywhere}
thead th{color:var(--quiet);font-weight:600;font-size:.9rem}
tbody th{font-weight:400}
svg{display:block;max-width:100%;height:auto}
svg text{fill:var(--text);font:12px system-ui,-apple-system,"Segoe UI",sans-serif}
svg .quiet{fill:var(--quiet)}
svg .end{text-anchor:end}svg .mid{text-anchor:middle}
svg.swatch{display:inline-block;margin-right:.5em;vertical-align:-1px}
svg .half{opacity:.5}
svg .grid{stroke:var(--line);fill:none}
svg .line{fill:none;stroke-width:1.6;stroke-linejoin:round}
svg .strong{stroke-width:2.6}svg .dash{stroke-dasharray:6 4}
.a{stroke:var(--a)}.b{stroke:var(--b)}.c{stroke:var(--c)}.d{stroke:var(--d)}.e{stroke:var(--e)}
svg .fa{fill:var(--a)}svg .fb{fill:var(--b)}svg .fc{fill:var(--c)}svg .fd{fill:var(--d)}svg .fe{fill:var(--e)}
svg .q{stroke:var(--quiet);opacity:.55}
@media print{:root{--page:#fff;--text:#000;--quiet:#444;--line:#bbb;--card:#fff;--good:#186a3b;--bad:#a61b1b;--a:#1f5fae;
--b:#b3540b;--c:#22794d;--d:#8a2f9c;--e:#8a6d00;color-scheme:light}
body{max-width:none;padding:0;font-size:10.5pt}nav{display:none}figure,table,.verdict{break-inside:avoid}
h2,h3{break-after:avoid}img,svg,.verdict{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
)";

}  // namespace

std::string HtmlTable::html() const {
  std::string out =
      sentences ? "<div class=\"scroll\"><table class=\"sentences\">" : "<div class=\"scroll\"><table>";
  out += "\n<caption>" + caption + "</caption>\n<thead><tr>";
  for (const std::string& cell : header) out += "<th scope=\"col\">" + cell + "</th>";
  out += "</tr></thead>\n<tbody>\n";
  for (const std::vector<std::string>& row : rows) {
    out += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i)
      out += i == 0 ? "<th scope=\"row\">" + row[i] + "</th>" : "<td>" + row[i] + "</td>";
    out += "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

std::string html_section(const std::string& id, const std::string& heading, const std::string& body) {
  return "<section aria-labelledby=\"" + id + "\">\n<h2 id=\"" + id + "\">" + heading + "</h2>\n" + body +
         "</section>\n";
}

std::string html_page(const std::string& title, const std::string& body) {
  std::string out(kReportFirstLine);
  out += page_beginning(title, "default-src 'none'; img-src 'self' file:; style-src 'unsafe-inline'");
  out += "<style>";
  out += kStyle;
  out += "</style>\n</head>\n<body>\n";
  out += body;
  return out + "</body>\n</html>\n";
}

}  // namespace texmesh
