void main(void) {
  // error: 'break' outside a loop or switch
  break;
  // error: 'continue' outside a loop
  continue;
  // error: 'case' outside a switch
  case 1: ;
  switch (PORTB) {
    case 1:
    // error: duplicate case 1
    case 1: break;
  }
  // error: 'main' returns void and cannot return a value
  return 1;
}
