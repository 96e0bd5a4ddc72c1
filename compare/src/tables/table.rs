//! A table without markup.

use super::{Cell, Emphasis};

/// Rows and columns, and what is said about them.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// A name for references to it, such as `scene-sponza`.
    pub name: String,
    /// What it shows, in sentences.
    pub caption: String,
    /// What standing out means in it.
    pub legend: Vec<(Emphasis, &'static str)>,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows; each has a cell for each column.
    pub rows: Vec<Row>,
}

/// The head of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// What it has in common with its neighbours, above its own head.
    pub group: Option<String>,
    /// Its head, in lines.
    pub head: Vec<String>,
    /// Where its cells stand.
    pub align: Align,
}

/// Where the cells of a column stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// On the left: words.
    Left,
    /// On the right: numbers.
    Right,
}

/// A row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its cells.
    pub cells: Vec<Cell>,
    /// Whether something new begins with it, so that it stands apart from the row above.
    pub apart: bool,
}

impl Column {
    /// A column of words.
    pub fn words(head: &str) -> Column {
        Column::new(head, Align::Left)
    }

    /// A column of numbers.
    pub fn numbers(head: &str) -> Column {
        Column::new(head, Align::Right)
    }

    /// A column whose head has a line for each of the text.
    pub fn new(head: &str, align: Align) -> Column {
        Column { group: None, head: head.split('\n').map(str::to_owned).collect(), align }
    }

    /// The same as part of a group.
    pub fn within(self, group: &str) -> Column {
        Column { group: Some(group.to_owned()), ..self }
    }
}

impl Row {
    /// A row.
    pub fn new(cells: Vec<Cell>) -> Row {
        Row { cells, apart: false }
    }

    /// A row with which something new begins, if that is so.
    pub fn apart(self, apart: bool) -> Row {
        Row { apart, ..self }
    }
}

impl Table {
    /// Groups of columns in their order, each with how many columns it has; a column without one is by itself.
    pub fn groups(&self) -> Vec<(Option<&str>, usize)> {
        let mut groups: Vec<(Option<&str>, usize)> = Vec::new();
        for column in &self.columns {
            match (groups.last_mut(), column.group.as_deref()) {
                (Some((Some(last), count)), Some(group)) if *last == group => *count += 1,
                (_, group) => groups.push((group, 1)),
            }
        }
        groups
    }

    /// What stands out in it, and why; what is absent from it needs no explanation.
    pub fn explained(&self) -> impl Iterator<Item = (Emphasis, &'static str)> {
        let stands =
            |emphasis| self.rows.iter().flat_map(|row| &row.cells).any(move |cell| cell.emphasis == emphasis);
        self.legend.iter().copied().filter(move |&(emphasis, _)| stands(emphasis))
    }
}
