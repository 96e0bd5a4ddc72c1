//! Says why a service did not do what it was asked.

use super::services::{LOGIN, SAVER, Service};
use zbus::{DBusError, Error, fdo};

/// Most characters that are passed on of what a service says.
const MOST: usize = 200;

/// How far things had come.
#[derive(Clone, Copy)]
pub(super) enum Stage {
    /// The bus was being greeted as this user.
    Entering(u32),
    /// The service was being asked.
    Asking,
}

/// The reason on one line, with a way out where one is known.
pub(super) fn refusal(service: &Service, stage: Stage, error: &Error) -> String {
    let Service { name, bus, .. } = service;
    if let Stage::Entering(uid) = stage {
        return match error {
            // A bus that does not want a user may say so, or hang up.
            Error::Handshake(_) | Error::InputOutput(_) => {
                format!("the {bus} does not let user {uid} in; it may be another user's")
            }
            error => format!("the {bus} does not answer as one: {}", tidy(&error.to_string())),
        };
    }
    match error {
        Error::FDO(error) => match &**error {
            fdo::Error::ServiceUnknown(_) | fdo::Error::NameHasNoOwner(_) => {
                format!("nothing on the {bus} is called {name}{}", way_out(service))
            }
            fdo::Error::AccessDenied(text)
            | fdo::Error::AuthFailed(text)
            | fdo::Error::InteractiveAuthorizationRequired(text) => {
                let way_out =
                    if *name == LOGIN.name { "; root may, and who sits at the machine" } else { "" };
                format!("{name} refuses: {}{way_out}", tidy(text))
            }
            fdo::Error::UnknownObject(_) | fdo::Error::UnknownInterface(_) | fdo::Error::UnknownMethod(_) => {
                format!("{name} has no Inhibit where it is looked for")
            }
            error => {
                let text = error.description().unwrap_or_default();
                format!("{name} fails with {}: {}", tidy(error.name().as_str()), tidy(text))
            }
        },
        Error::MethodError(kind, text, _) => {
            let text = text.as_deref().unwrap_or("no reason given");
            format!("{name} fails with {}: {}", tidy(kind.as_str()), tidy(text))
        }
        Error::InputOutput(_) => format!("the {bus} hung up"),
        error => format!("{name} answers something else: {}", tidy(&error.to_string())),
    }
}

fn way_out(service: &Service) -> &'static str {
    if service.name == SAVER.name { "; turn the screen saver off in the desktop's settings" } else { "" }
}

/// Whether the service is there, but not at the path it was asked at. Services differ in how they
/// say that.
pub(super) fn is_unknown_object(error: &Error) -> bool {
    let Error::FDO(error) = error else { return false };
    matches!(
        **error,
        fdo::Error::UnknownObject(_) | fdo::Error::UnknownInterface(_) | fdo::Error::UnknownMethod(_)
    )
}

/// Makes one short line of what somebody else wrote, so that it cannot pass for more than that on a
/// terminal.
fn tidy(text: &str) -> String {
    let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(MOST).collect();
    if line.trim().is_empty() { "no reason given".into() } else { line.trim().into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_write_stays_on_one_short_line() {
        assert_eq!(tidy(" no\x1b[2J\nway\u{9b} "), "no [2J way");
        assert_eq!(tidy(&"x".repeat(1000)).len(), MOST);
        assert_eq!(tidy("\n"), "no reason given");
    }
}
