//! Horizontal bars that wrap with the page: labels above, values beside.

use crate::page::escape;
use std::fmt::Write;

/// Style of the bars and of the verdict.
pub const STYLE: &str = "<style>:root{--a:#0072b2;--b:#d55e00;--c:#009e73}\
@media (prefers-color-scheme:dark){:root{--a:#4da3dc;--b:#ff8a3c;--c:#2fc79a}}\
.verdict{border-left:6px solid var(--a);background:var(--soft);padding:.7rem 1rem;margin:.8rem 0}.verdict strong{font-size:1.25rem;line-height:1.3;display:block;margin-bottom:.3rem}\
.verdict.explained,.verdict.law{border-color:var(--b)}.verdict.ambiguous,.verdict.incomplete,.verdict.unconfirmed,.verdict.unexplained{border-color:#b8860b}.verdict.adequate{border-color:var(--c)}\
svg.map{width:100%;height:auto;display:block}svg.map text{font:16px system-ui,sans-serif;fill:currentColor}\
.bars{max-width:46rem}.bar{margin:.35rem 0}.bar>span{font-size:.92rem}.bar>div{display:flex;align-items:center;gap:.6rem}\
.track{position:relative;flex:1;height:.85rem;background:var(--soft);min-width:0}.track>i{position:absolute;left:0;top:0;bottom:0}\
.track>u{position:absolute;top:42%;height:2px;background:var(--ink)}.track>b{position:absolute;top:-2px;bottom:-2px;width:2px;background:var(--ink);opacity:.55}\
.bar output{flex:0 0 4.5rem;font-size:.88rem;font-variant-numeric:tabular-nums}.c0{background:var(--a)}.c1{background:var(--b)}.c2{background:var(--c)}\
.key{font-size:.88rem;opacity:.9}.key i{display:inline-block;width:.9rem;height:.7rem;margin:0 .3rem 0 .8rem}.scale{display:inline-block;width:7rem;height:.8rem;vertical-align:middle;margin:0 .4rem;border:1px solid var(--line);background:linear-gradient(to right,rgb(30,125,205),transparent,rgb(226,106,0))}\
details{margin:.4rem 0}summary{cursor:pointer}li{margin:.2rem 0}</style>";

/// One bar of a group.
pub struct Bar {
    /// Which colour, 0 to 2.
    pub colour: usize,
    /// Its end, as a share of the width.
    pub share: f64,
    /// Ends of an interval, likewise.
    pub interval: Option<(f64, f64)>,
    /// What stands beside it.
    pub text: String,
}

/// Bars below one label, all with the same mark where there is one (a share of the width).
pub fn group(label: &str, bars: &[Bar], mark: Option<f64>) -> String {
    let percent = |share: f64| 100.0 * if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    let mut html = format!("<div class=\"bar\"><span>{}</span>", escape(label));
    for bar in bars {
        let width = percent(bar.share);
        let _ = write!(
            html,
            "<div><div class=\"track\"><i class=\"c{}\" style=\"width:{width:.1}%\"></i>",
            bar.colour
        );
        if let Some((low, high)) = bar.interval {
            let (low, high) = (percent(low), percent(high));
            let _ = write!(html, "<u style=\"left:{low:.1}%;width:{:.1}%\"></u>", (high - low).max(0.3));
        }
        if let Some(mark) = mark {
            let _ = write!(html, "<b style=\"left:{:.1}%\"></b>", percent(mark));
        }
        let _ = write!(html, "</div><output>{}</output></div>", escape(&bar.text));
    }
    html + "</div>"
}
