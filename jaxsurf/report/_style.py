"""The style sheet of a report: light and dark, narrow and wide, screen and print."""

STYLE = """
:root { color-scheme: light dark; --ink: #1c2530; --soft: #5b6673; --line: #d9dee4; --paper: #ffffff; --card:
#f6f8fa; --above: #c0392b; --below: #2a6fb0; --accent: #1f4e79; } @media (prefers-color-scheme: dark) { :root
{ --ink: #e4e8ed; --soft: #9aa5b1; --line: #38414c; --paper: #14181d; --card: #1d232a; --above: #e8705f;
--below: #6aa7e0; --accent: #8dbbe6; } } * { box-sizing: border-box; } body { margin: 0 auto; padding: 1.5rem
1rem 3rem; max-width: 60rem; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui,
-apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; } h1 { font-size: 1.6rem; line-height:
1.25; margin: 0 0 .6rem; overflow-wrap: anywhere; } h2 { font-size: 1.12rem; margin: 2.2rem 0 .7rem; color:
var(--accent); } .note-box { border-left: 4px solid var(--accent); background: var(--card); padding: .5rem
.9rem; margin: .6rem 0; } .scroll { overflow-x: auto; } table { border-collapse: collapse; width: 100%;
font-variant-numeric: tabular-nums; } th, td { padding: .36rem .7rem; text-align: left; border-bottom: 1px
solid var(--line); vertical-align: top; } th { font-weight: 600; color: var(--soft); } tbody th { font-weight:
400; } .scroll td { white-space: nowrap; } td.number, th.number { text-align: right; white-space: nowrap; }
td.unit { color: var(--soft); width: 6rem; padding-left: 0; } .made th { width: 11rem; white-space: nowrap; }
.made td { font-family: ui-monospace, SFMono-Regular, Menlo, Consolas, "DejaVu Sans Mono", monospace;
font-size: .86rem; overflow-wrap: anywhere; } figure { margin: 0 0 1.4rem; } figure img { width: 100%; height:
auto; display: block; border: 1px solid var(--line); border-radius: 6px; background: #fff; } figcaption {
color: var(--soft); font-size: .92rem; margin-top: .35rem; } svg { width: 100%; height: auto; display: block;
color: var(--ink); } svg text { font-size: 12.5px; fill: var(--soft); } svg text.note { fill: var(--ink); }
svg .grid { stroke: var(--line); stroke-width: 1; } svg .axis { stroke: var(--soft); stroke-width: 1; } svg
.above { fill: var(--above); } svg .below { fill: var(--below); } svg .rms { stroke: var(--ink); stroke-width:
1.2; stroke-dasharray: 5 4; } @media (max-width: 34rem) { body { font-size: 15px; } th, td { padding: .32rem
.4rem; } .made th { width: auto; white-space: normal; } td.unit { width: auto; } svg text { font-size: 17px; }
} @media print { :root { --ink: #000; --soft: #444; --line: #bbb; --paper: #fff; --card: #f4f4f4; --above:
#b03024; --below: #1f5f9f; --accent: #000; } body { max-width: none; padding: 0; font-size: 10.5pt; } figure,
svg, tr { break-inside: avoid; } h2 { break-after: avoid; } * { print-color-adjust: exact; } }
"""
