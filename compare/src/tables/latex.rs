//! Tables as LaTeX, with the packages booktabs, xcolor and graphicx.

use super::{Align, Cell, Column, Emphasis, Row, Table};

/// A table with more rows than this is broken into parts, each with a page of its own.
const ROWS_OF_A_PAGE: usize = 40;

/// What a document must load for the tables.
const PACKAGES: &str = "\\usepackage{booktabs}\n\\usepackage{xcolor}\n\\usepackage{graphicx}\n";

/// Tables as a part of a document.
pub fn fragment(tables: &[Table]) -> String {
    let needs = PACKAGES.lines().map(|line| format!("%   {line}\n")).collect::<String>();
    format!("% In the preamble:\n%   \\usepackage[utf8]{{inputenc}}\n{needs}\n{}", bodies(tables))
}

/// Tables as a document of their own.
pub fn document(tables: &[Table]) -> String {
    format!(
        "\\documentclass[a4paper]{{article}}\n\\usepackage[utf8]{{inputenc}}\n\
         \\usepackage[landscape,margin=15mm]{{geometry}}\n{PACKAGES}\\begin{{document}}\n\n{}\n\\end{{document}}\n",
        bodies(tables)
    )
}

fn bodies(tables: &[Table]) -> String {
    let mut names: Vec<String> = Vec::new();
    let mut bodies = Vec::new();
    for table in tables {
        let name = label(&table.name);
        let taken = names.iter().filter(|known| **known == name).count();
        // A label that is there twice would be one too many for LaTeX.
        let own = if taken == 0 { name.clone() } else { format!("{name}-{}", taken + 1) };
        names.push(name);
        bodies.push(body(table, &own));
    }
    bodies.join("\n")
}

fn body(table: &Table, label: &str) -> String {
    let columns: String = (table.columns.iter())
        .map(|column| match column.align {
            Align::Left => 'l',
            Align::Right => 'r',
        })
        .collect();
    let head = head(table);
    let parts = parts(&table.rows).into_iter().enumerate().map(|(at, rows)| {
        let title = match at {
            0 => format!("\\caption{{{}}}\n\\label{{tab:{label}}}", caption(table)),
            _ => format!("Table~\\ref{{tab:{label}}}, continued\\par"),
        };
        let rows: String = rows.iter().enumerate().map(|(nth, own)| row(own, nth > 0)).collect();
        // What is wider than the text is made smaller.
        format!(
            "\\begin{{table}}[htbp]\n\\centering\n{title}\n\\medskip\n\\footnotesize\n\\setlength{{\\tabcolsep}}{{4pt}}\n\
             \\resizebox{{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}}{{!}}{{%\n\
             \\begin{{tabular}}{{{columns}}}\n\\toprule\n{head}\\midrule\n{rows}\\bottomrule\n\\end{{tabular}}}}\n\
             \\end{{table}}\n"
        )
    });
    parts.collect::<Vec<_>>().join("\n")
}

/// Rows by page: as many as fit, and where something new begins near the end of a page, that is where it breaks.
fn parts(rows: &[Row]) -> Vec<&[Row]> {
    let mut parts = Vec::new();
    let mut rest = rows;
    while rest.len() > ROWS_OF_A_PAGE {
        let near = ROWS_OF_A_PAGE / 2..=ROWS_OF_A_PAGE;
        let end = near.rev().find(|&at| rest[at].apart).unwrap_or(ROWS_OF_A_PAGE);
        let (part, after) = rest.split_at(end);
        parts.push(part);
        rest = after;
    }
    parts.push(rest);
    parts
}

fn caption(table: &Table) -> String {
    let mut text = escaped(&table.caption);
    for (emphasis, meaning) in table.explained() {
        let name = match emphasis {
            Emphasis::Plain => continue,
            Emphasis::Best => "Bold",
            Emphasis::Poor => "Bold and red",
        };
        text += &format!(" {name}: {}.", escaped(meaning));
    }
    text
}

/// Heads of columns, in as many rows as the tallest has; short ones stand below.
fn head(table: &Table) -> String {
    let mut text = String::new();
    let groups = table.groups();
    if groups.iter().any(|(group, _)| group.is_some()) {
        let (mut heads, mut rules, mut first) = (Vec::new(), String::new(), 1);
        for (group, count) in groups {
            if let Some(group) = group {
                heads.push(format!("\\multicolumn{{{count}}}{{c}}{{{}}}", escaped(group)));
                rules += &format!("\\cmidrule(lr){{{first}-{}}}", first + count - 1);
            } else {
                heads.push(String::new());
            }
            first += count;
        }
        text += &format!("{} \\\\\n", heads.join(" & "));
        // A rule between a group and its columns; the one below the head does where these have no heads.
        let below =
            |column: &Column| column.group.is_some() && column.head.iter().any(|part| !part.is_empty());
        if table.columns.iter().any(below) {
            text += &format!("{rules}\n");
        }
    }
    let tallest = table.columns.iter().map(|column| column.head.len()).max().unwrap_or(0);
    for line in 0..tallest {
        let part = |column: &Column| {
            let above = tallest - column.head.len();
            line.checked_sub(above)
                .and_then(|at| column.head.get(at))
                .map_or_else(String::new, |part| escaped(part))
        };
        let parts: Vec<String> = table.columns.iter().map(part).collect();
        if parts.iter().any(|part| !part.is_empty()) {
            text += &format!("{} \\\\\n", parts.join(" & "));
        }
    }
    text
}

fn row(row: &Row, follows: bool) -> String {
    let space = if row.apart && follows { "\\addlinespace\n" } else { "" };
    format!("{space}{} \\\\\n", row.cells.iter().map(cell).collect::<Vec<_>>().join(" & "))
}

fn cell(cell: &Cell) -> String {
    let text = escaped(&cell.to_string());
    match cell.emphasis {
        Emphasis::Plain => text,
        Emphasis::Best => format!("\\textbf{{{text}}}"),
        Emphasis::Poor => format!("\\textbf{{\\textcolor{{red}}{{{text}}}}}"),
    }
}

/// A name that labels may have.
fn label(name: &str) -> String {
    name.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' }).collect()
}

/// A text in which nothing is markup, and in which pdfLaTeX knows every letter: one that it does not know is given
/// by its number.
pub fn escaped(text: &str) -> String {
    let mut out = String::new();
    for letter in text.chars() {
        match letter {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => out.extend(['\\', letter]),
            '\\' => out += "\\textbackslash{}",
            '~' => out += "\\textasciitilde{}",
            '^' => out += "\\textasciicircum{}",
            '<' => out += "\\textless{}",
            '>' => out += "\\textgreater{}",
            '|' => out += "\\textbar{}",
            '"' => out += "''",
            '\'' => out += "\\textquotesingle{}",
            '`' => out += "\\textasciigrave{}",
            // In brackets a line's first letter could be taken for an option of the row break above it.
            '[' | ']' => out.extend(['{', letter, '}']),
            '*' => out += "{*}",
            // Two in a row would become a dash.
            '-' => out += "{-}",
            '–' => out += "--",
            '—' => out += "---",
            '×' => out += "$\\times$",
            '±' => out += "$\\pm$",
            'µ' | 'μ' => out += "$\\mu$",
            'ₜ' => out += "$_t$",
            'ᵢ' => out += "$_i$",
            letter if letter.is_ascii_graphic() || letter == ' ' => out.push(letter),
            letter if letter.is_whitespace() || letter.is_control() => out.push(' '),
            letter if known(letter) => out.push(letter),
            letter => out += &format!("{{[}}U+{:04X}{{]}}", u32::from(letter)),
        }
    }
    out
}

/// Whether pdfLaTeX knows a letter beyond ASCII in the fonts that it begins with (encoding OT1): most of those with
/// accents.
fn known(letter: char) -> bool {
    matches!(letter, 'À'..='ſ') && !"ÐÞðþĄąĐđĘęĦħĮįĸĿŀŉŊŋŦŧŲųſ".contains(letter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_a_value_is_markup() {
        assert_eq!(escaped(r"a_b & 50% $x$ #1 {y} \z"), r"a\_b \& 50\% \$x\$ \#1 \{y\} \textbackslash{}z");
        assert_eq!(
            escaped("Lukáš 'a' \"b\" ą"),
            "Lukáš \\textquotesingle{}a\\textquotesingle{} ''b'' {[}U+0105{]}"
        );
        assert_eq!(escaped("32 × 2 – cₜ\n日"), "32 $\\times$ 2 -- c$_t$ {[}U+65E5{]}");
        assert_eq!(label("scene-bistro_int é"), "scene-bistro-int--");
    }
}
