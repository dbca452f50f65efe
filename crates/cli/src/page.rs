//! One self-contained HTML page: no network, readable on a phone and in dark mode.

use base64::Engine;
use std::fmt::Write;

const STYLE: &str = ":root{color-scheme:light dark;--ink:#222;--paper:#fff;--line:#ddd;--soft:#f5f5f3;--warn:#8a4b00;--warnbg:#fff6e5}\
@media (prefers-color-scheme: dark){:root{--ink:#e4e4e4;--paper:#161616;--line:#3a3a3a;--soft:#212121;--warn:#ffc46b;--warnbg:#2c2312}}\
*{box-sizing:border-box}body{margin:0 auto;max-width:74rem;padding:1rem 1.2rem 3rem;font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper)}\
h1{font-size:1.7rem;line-height:1.2;margin:.6rem 0 .2rem}h2{font-size:1.15rem;margin:1.6rem 0 .4rem}p{margin:.3rem 0 .8rem;max-width:60rem}\
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,26rem),1fr));gap:1rem 2rem}.grid>section,.small>figure{min-width:0}.small{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,15rem),1fr));gap:.6rem 1.2rem}\
.scroll{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.92rem}\
th,td{padding:.25rem .6rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}th:first-child,td:first-child{text-align:left}\
svg.chart,img{width:100%;height:auto;display:block}img.spectrogram{border:1px solid var(--line);height:13rem}table{margin-bottom:1rem}audio{width:100%;margin:.2rem 0 .6rem}\
.warn{border-left:4px solid var(--warn);background:var(--warnbg);padding:.5rem .8rem;margin:.5rem 0}.warn ul{margin:.2rem 0;padding-left:1.2rem}\
.soft{background:var(--soft);padding:.6rem .8rem}figure{margin:0}figcaption{font-size:.9rem;opacity:.8}";

/// An HTML page under construction.
pub struct Page {
    body: String,
    title: String,
}

/// Text with the characters that HTML reserves replaced.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl Page {
    /// An empty page with a title.
    pub fn new(title: &str) -> Self {
        Self { body: format!("<h1>{}</h1>", escape(title)), title: escape(title) }
    }

    /// Adds markup as it is.
    pub fn markup(&mut self, html: &str) -> &mut Self {
        self.body.push_str(html);
        self.body.push('\n');
        self
    }

    /// Adds a section heading.
    pub fn heading(&mut self, text: &str) -> &mut Self {
        self.markup(&format!("<h2>{}</h2>", escape(text)))
    }

    /// Adds a paragraph of plain text.
    pub fn paragraph(&mut self, text: &str) -> &mut Self {
        self.markup(&format!("<p>{}</p>", escape(text)))
    }

    /// Adds warnings in words, or nothing if there are none.
    pub fn warnings(&mut self, warnings: &[String]) -> &mut Self {
        if warnings.is_empty() {
            return self;
        }
        let items: String = warnings.iter().map(|w| format!("<li>{}</li>", escape(w))).collect();
        self.markup(&format!(
            "<div class=\"warn\" role=\"note\"><strong>Worth knowing</strong><ul>{items}</ul></div>"
        ))
    }

    /// Adds a table; the first row is its head.
    pub fn table(&mut self, rows: &[Vec<String>]) -> &mut Self {
        let mut html = String::from("<div class=\"scroll\"><table>");
        for (i, row) in rows.iter().enumerate() {
            let cell = if i == 0 { "th" } else { "td" };
            html.push_str("<tr>");
            for text in row {
                let _ = write!(html, "<{cell}>{}</{cell}>", escape(text));
            }
            html.push_str("</tr>");
        }
        html.push_str("</table></div>");
        self.markup(&html)
    }

    /// Adds a picture, given as PNG.
    pub fn picture(&mut self, png: &[u8], caption: &str) -> &mut Self {
        let data = base64::engine::general_purpose::STANDARD.encode(png);
        let caption = escape(caption);
        self.markup(&format!(
            "<figure><img class=\"spectrogram\" alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
        ))
    }

    /// Adds a player for a WAV file's bytes.
    pub fn player(&mut self, wav: &[u8], caption: &str) -> &mut Self {
        let data = base64::engine::general_purpose::STANDARD.encode(wav);
        self.markup(&format!(
            "<figure><figcaption>{}</figcaption><audio controls preload=\"metadata\" src=\"data:audio/wav;base64,{data}\"></audio></figure>",
            escape(caption)
        ))
    }

    /// The whole page.
    pub fn html(&self) -> String {
        format!(
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{}</title><style>{STYLE}</style></head><body>\n{}</body></html>\n",
            self.title, self.body
        )
    }
}
