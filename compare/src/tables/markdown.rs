//! Tables as Markdown, in the form that GitHub and pandoc read.

use super::{Align, Cell, Emphasis, Table};

/// Tables with their captions, ready for a page.
pub fn page(tables: &[Table]) -> String {
    let tables: Vec<String> = tables.iter().map(table).collect();
    tables.join("\n")
}

fn table(table: &Table) -> String {
    let mut caption = escaped(&table.caption);
    for (emphasis, meaning) in table.explained() {
        let name = if emphasis == Emphasis::Poor { "Italic" } else { "Bold" };
        caption += &format!(" {}: {}.", marked(name, emphasis), escaped(meaning));
    }
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    // Markdown has one line of heads, so a group goes in front of each of its columns.
    let heads = table.columns.iter().map(|column| {
        let words = column.group.iter().chain(&column.head).filter(|word| !word.is_empty());
        escaped(&words.cloned().collect::<Vec<_>>().join(" "))
    });
    let rules = table.columns.iter().map(|column| {
        match column.align {
            Align::Left => "---",
            Align::Right => "---:",
        }
        .to_owned()
    });
    let mut text = format!("{caption}\n\n{}{}", line(heads.collect()), line(rules.collect()));
    for row in &table.rows {
        text += &line(row.cells.iter().map(cell).collect());
    }
    text
}

fn cell(cell: &Cell) -> String {
    marked(&escaped(&cell.to_string()), cell.emphasis)
}

fn marked(text: &str, emphasis: Emphasis) -> String {
    match emphasis {
        Emphasis::Plain => text.to_owned(),
        Emphasis::Best => format!("**{text}**"),
        Emphasis::Poor => format!("*{text}*"),
    }
}

/// A text in which nothing is markup.
pub fn escaped(text: &str) -> String {
    let mut out = String::new();
    for letter in text.chars() {
        match letter {
            '\\' | '|' | '*' | '_' | '`' | '[' | ']' | '<' | '>' | '#' | '~' | '$' => {
                out.extend(['\\', letter])
            }
            '&' => out += "&amp;",
            letter if letter.is_control() => out.push(' '),
            letter => out.push(letter),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_a_value_is_markup() {
        assert_eq!(escaped("a_b*c|d\n<e> `f` &g"), r"a\_b\*c\|d \<e\> \`f\` &amp;g");
    }
}
